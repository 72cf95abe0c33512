"""Events reach a real receiver in order per tag, through refusals, outages and slow answers."""

import asyncio
import ssl
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from dropanchor_schemas.destinations import WebhookDestination
from dropanchor_schemas.zones import EventType
from dropanchor_service.delivery import queue
from dropanchor_service.delivery.channel import Outcome, Verdict
from dropanchor_service.delivery.signature import headers
from dropanchor_service.security.authority import Authority, Issued
from support.delivery import SECRET, DeliveryBench, in_order
from support.patience import PATIENCE_S
from support.receiver import Receiver, running_receiver
from support.zenoh_router import wait_until


@pytest.fixture(autouse=True)
def _fast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queue, "FIRST_RETRY_S", 0.05)


@contextmanager
def delivering(bench: DeliveryBench, receiver: Receiver) -> Iterator[None]:
    with running_receiver(receiver):
        bench.hook(receiver)
        with bench.thread:
            yield


def test_every_event_comes_once_in_order_and_signed() -> None:
    bench, receiver = DeliveryBench(), Receiver()
    with delivering(bench, receiver):
        for _ in range(20):
            bench.happen("a", "b", "c")
        wait_until(lambda: bench.counts() == (0, 0))
    assert len(receiver.accepted) == 60
    assert in_order(receiver.accepted)
    sent, body = receiver.requests[0]
    assert sent["content-type"].startswith("application/cloudevents+json")
    assert sent.items() >= headers(SECRET, sent["webhook-id"], int(sent["webhook-timestamp"]), body).items()
    assert abs(int(sent["webhook-timestamp"]) - time.time()) < 60
    assert sent["host"] == f"127.0.0.1:{receiver.port}"


@pytest.mark.parametrize("status", [500, 503, 429])
def test_an_unavailable_receiver_gets_everything_later_in_order(status: int) -> None:
    bench, receiver = DeliveryBench(), Receiver(status=status)
    with delivering(bench, receiver):
        for _ in range(5):
            bench.happen("a", "b")
        wait_until(lambda: len(receiver.requests) >= 3)
        assert bench.counts() == (10, 0)
        assert str(status) in (bench.thread.problem_of(0, "mes") or "")
        receiver.status = 200
        wait_until(lambda: bench.counts() == (0, 0) and bench.thread.problem_of(0, "mes") is None)
    assert len(receiver.accepted) == 10
    assert in_order(receiver.accepted)


def test_a_refused_event_becomes_a_dead_letter_and_holds_up_only_its_tag() -> None:
    bench, receiver = DeliveryBench(), Receiver(refused_subjects={"bad"})
    with delivering(bench, receiver):
        bench.happen("bad", "good", "bad", "good")
        wait_until(lambda: receiver.subjects() == ["good", "good"])
        wait_until(lambda: bench.counts() == (0, 2))
        assert [reason for _, reason in bench.deliveries.dead("mes")] == ["the receiver answered 400 Bad Request"] * 2
        receiver.refused_subjects.clear()
        assert bench.deliveries.retry("mes", time.time_ns()) == 2
        wait_until(lambda: bench.counts() == (0, 0))
    assert receiver.subjects() == ["good", "good", "bad", "bad"]
    assert in_order(receiver.accepted)


def test_an_event_that_is_too_old_becomes_a_dead_letter() -> None:
    bench, receiver = DeliveryBench(give_up_s=0.5), Receiver(status=500)
    with delivering(bench, receiver):
        bench.happen("a")
        wait_until(lambda: bench.counts() == (0, 1))
    assert "given up" in bench.deliveries.dead("mes")[0][1]


def test_a_receiver_that_does_not_answer_delays_no_other() -> None:
    bench, slow, fast = DeliveryBench(), Receiver(), Receiver()
    with running_receiver(slow), delivering(bench, fast):
        slow.release.clear()
        bench.hook(slow, "slow")
        for _ in range(10):
            bench.happen("a")
        wait_until(lambda: bench.counts() == (0, 0))
        assert bench.counts("slow") == (10, 0)
        slow.release.set()


def test_a_name_whose_server_does_not_answer_delays_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, slow, fast = DeliveryBench(timeout_s=2.0), Receiver(), Receiver()
    is_over = threading.Event()

    def resolving(url: httpx.URL) -> list[str]:
        if url.port == slow.port:
            is_over.wait(PATIENCE_S)
        return ["127.0.0.1"]

    monkeypatch.setattr("dropanchor_service.delivery.webhook.resolved", resolving)
    with running_receiver(slow), delivering(bench, fast):
        bench.hook(slow, "slow")
        for _ in range(3):
            bench.happen(*map(str, range(40)))
            wait_until(lambda: bench.counts() == (0, 0), PATIENCE_S / 2)
            wait_until(lambda: bench.thread.problem_of(0, "slow") == "there was no answer within 2 s")
        is_over.set()


def test_a_redirect_is_not_followed() -> None:
    bench, receiver = DeliveryBench(), Receiver(status=302)
    with delivering(bench, receiver):
        bench.happen("a")
        wait_until(lambda: bench.counts() == (0, 1))
    assert "302" in bench.deliveries.dead("mes")[0][1]


def test_a_name_that_turns_inside_later_is_refused_at_every_delivery(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, receiver = DeliveryBench(), Receiver()
    monkeypatch.setattr("dropanchor_service.delivery.webhook.resolved", lambda _: ["10.0.0.1"])
    with delivering(bench, receiver):
        bench.happen("a")
        wait_until(lambda: "10.0.0.1, which is not public" in (bench.thread.problem_of(0, "mes") or ""))
    assert receiver.requests == []


def test_a_webhook_gets_only_what_it_wants() -> None:
    bench, receiver = DeliveryBench(), Receiver()
    with delivering(bench, receiver):
        bench.hook(receiver, tags=["a"], zones=["dock"], types=[EventType.ZONE_ENTER])
        bench.hook(receiver, "off", enabled=False)
        bench.hook(receiver, "exits", types=[EventType.ZONE_EXIT])
        bench.hook(receiver, "gate", zones=["gate"])
        bench.happen("a", "b")
        wait_until(lambda: bench.deliveries.states() == {})
    assert receiver.subjects() == ["a"]


def test_a_certificate_must_be_of_the_host_in_the_url_although_the_address_is_what_is_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dropanchor_service.delivery.webhook.resolved", lambda _: ["127.0.0.1"])
    authority, receiver = Authority.make("yard"), Receiver()
    (tmp_path / "ca.pem").write_bytes(authority.issued.certificate)
    bench = DeliveryBench(authorities=tmp_path / "ca.pem")

    async def send_to(host: str) -> Outcome:
        url = f"https://{host}:{receiver.port}/"
        async with bench.channels.open(WebhookDestination(type="webhook", id="mes", url=url, secret=SECRET)) as channel:
            return (await channel.send([b'{"id": "1", "subject": "a"}']))[0]

    with running_receiver(receiver, server_context(authority.server("mes", ["mes.example.com"], 1), tmp_path)):
        assert asyncio.run(send_to("mes.example.com")).verdict is Verdict.ACCEPTED
        refused = asyncio.run(send_to("other.example.com"))
    assert refused.verdict is Verdict.UNAVAILABLE
    assert "other.example.com" in refused.detail
    assert len(receiver.accepted) == 1


def server_context(issued: Issued, folder: Path) -> ssl.SSLContext:
    (folder / "server.pem").write_bytes(issued.certificate + issued.key)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(folder / "server.pem")
    return context
