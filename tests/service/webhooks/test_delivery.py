"""Events reach a real receiver in order per tag, through refusals, outages and slow answers."""

import asyncio
import ipaddress
import ssl
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dropanchor_schemas.events import EventType
from dropanchor_schemas.webhooks import Webhook
from dropanchor_service.events.database import Database
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.events.drafts import Draft
from dropanchor_service.events.store import EventStore
from dropanchor_service.security.authority import Authority, Issued
from dropanchor_service.webhooks import queue
from dropanchor_service.webhooks.queue import Patience
from dropanchor_service.webhooks.registry import addressees, open_webhooks
from dropanchor_service.webhooks.sender import Outcome, Sender, Verdict
from dropanchor_service.webhooks.signature import headers
from dropanchor_service.webhooks.thread import WebhookThread
from support.receiver import Receiver, running_receiver
from support.zenoh_router import wait_until

SECRET = "whsec_ZHJvcGFuY2hvci1leGFtcGxlLXNlY3JldC0wMQ=="
LOOPBACK = [ipaddress.ip_network("127.0.0.0/8")]


class Bench:
    """Webhooks of this process, without a service."""

    def __init__(self, give_up_s: float = 3600.0, timeout_s: float = 2.0) -> None:
        database = Database(None)
        self.webhooks = open_webhooks(None)
        self.store = EventStore(database, "yard", lambda draft: addressees(self.webhooks, draft))
        self.deliveries = Deliveries(database)
        sender = Sender(timeout_s, LOOPBACK)
        patience = Patience(retry_s=0.2, give_up_ns=round(give_up_s * 1e9))
        self.thread = WebhookThread(self.webhooks, self.deliveries, sender, patience, time.time_ns)

    def hook(self, receiver: Receiver, name: str = "mes", **fields: object) -> None:
        url = f"http://127.0.0.1:{receiver.port}/events"
        self.webhooks.put(name, Webhook(id=name, url=url, secret=SECRET, **fields))  # type: ignore[arg-type]

    def happen(self, *tags: str) -> None:
        now_ns = time.time_ns()
        self.store.commit(
            [Draft(EventType.ZONE_ENTER, tag, {"t_ns": now_ns, "since_ns": now_ns, "zone": "dock"}) for tag in tags], {}
        )

    def counts(self, name: str = "mes") -> tuple[int, int]:
        return self.deliveries.counts().get(name, (0, 0))


@pytest.fixture(autouse=True)
def _fast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queue, "FIRST_RETRY_S", 0.05)


@contextmanager
def delivering(bench: Bench, receiver: Receiver) -> Iterator[None]:
    with running_receiver(receiver):
        bench.hook(receiver)
        with bench.thread:
            yield


def in_order(receiver: Receiver) -> bool:
    """Return whether the first arrivals of the events of every tag came in order."""
    seen: set[str] = set()
    by_tag: dict[str, list[str]] = defaultdict(list)
    for event in receiver.accepted:
        if event["id"] not in seen:
            seen.add(event["id"])
            by_tag[event["subject"]].append(event["sequence"])
    return all(sequences == sorted(sequences) for sequences in by_tag.values())


def test_every_event_comes_once_in_order_and_signed() -> None:
    bench, receiver = Bench(), Receiver()
    with delivering(bench, receiver):
        for _ in range(20):
            bench.happen("a", "b", "c")
        wait_until(lambda: bench.counts() == (0, 0))
    assert len(receiver.accepted) == 60
    assert in_order(receiver)
    sent, body = receiver.requests[0]
    assert sent["content-type"].startswith("application/cloudevents+json")
    assert sent.items() >= headers(SECRET, sent["webhook-id"], int(sent["webhook-timestamp"]), body).items()
    assert abs(int(sent["webhook-timestamp"]) - time.time()) < 60
    assert sent["host"] == f"127.0.0.1:{receiver.port}"


@pytest.mark.parametrize("status", [500, 503, 429])
def test_an_unavailable_receiver_gets_everything_later_in_order(status: int) -> None:
    bench, receiver = Bench(), Receiver(status=status)
    with delivering(bench, receiver):
        for _ in range(5):
            bench.happen("a", "b")
        wait_until(lambda: len(receiver.requests) >= 3)
        assert bench.counts() == (10, 0)
        assert str(status) in (bench.thread.problem_of("mes") or "")
        receiver.status = 200
        wait_until(lambda: bench.counts() == (0, 0))
        assert bench.thread.problem_of("mes") is None
    assert len(receiver.accepted) == 10
    assert in_order(receiver)


def test_a_refused_event_becomes_a_dead_letter_and_holds_up_only_its_tag() -> None:
    bench, receiver = Bench(), Receiver(refused_subjects={"bad"})
    with delivering(bench, receiver):
        bench.happen("bad", "good", "bad", "good")
        wait_until(lambda: receiver.subjects() == ["good", "good"])
        wait_until(lambda: bench.counts() == (0, 2))
        assert [reason for _, reason in bench.deliveries.dead("mes")] == ["the receiver answered 400 Bad Request"] * 2
        receiver.refused_subjects.clear()
        assert bench.deliveries.retry("mes") == 2
        wait_until(lambda: bench.counts() == (0, 0))
    assert receiver.subjects() == ["good", "good", "bad", "bad"]
    assert in_order(receiver)


def test_an_event_that_is_too_old_becomes_a_dead_letter() -> None:
    bench, receiver = Bench(give_up_s=0.5), Receiver(status=500)
    with delivering(bench, receiver):
        bench.happen("a")
        wait_until(lambda: bench.counts() == (0, 1))
    assert "given up" in bench.deliveries.dead("mes")[0][1]


def test_a_receiver_that_does_not_answer_delays_no_other() -> None:
    bench, slow, fast = Bench(timeout_s=0.3), Receiver(), Receiver()
    with running_receiver(slow), delivering(bench, fast):
        slow.release.clear()
        bench.hook(slow, "slow")
        for _ in range(10):
            bench.happen("a")
        wait_until(lambda: bench.counts() == (0, 0))
        assert bench.counts("slow") == (10, 0)
        wait_until(lambda: bench.thread.problem_of("slow") == "there was no answer within 0.3 s")


def test_a_redirect_is_not_followed() -> None:
    bench, receiver = Bench(), Receiver(status=302)
    with delivering(bench, receiver):
        bench.happen("a")
        wait_until(lambda: bench.counts() == (0, 1))
    assert "302" in bench.deliveries.dead("mes")[0][1]


def test_a_name_that_turns_inside_later_is_refused_at_every_delivery(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, receiver = Bench(), Receiver()
    monkeypatch.setattr("dropanchor_service.webhooks.sender.resolved", lambda _: ["10.0.0.1"])
    with delivering(bench, receiver):
        bench.happen("a")
        wait_until(lambda: "10.0.0.1, which is not public" in (bench.thread.problem_of("mes") or ""))
    assert receiver.requests == []


def test_a_webhook_gets_only_what_it_wants() -> None:
    bench, receiver = Bench(), Receiver()
    with delivering(bench, receiver):
        bench.hook(receiver, tags=["a"], zones=["dock"], types=[EventType.ZONE_ENTER])
        bench.hook(receiver, "off", enabled=False)
        bench.hook(receiver, "exits", types=[EventType.ZONE_EXIT])
        bench.hook(receiver, "gate", zones=["gate"])
        bench.happen("a", "b")
        wait_until(lambda: receiver.subjects() == ["a"])
    assert bench.deliveries.counts() == {}


def test_a_certificate_must_be_of_the_host_in_the_url_although_the_address_is_what_is_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dropanchor_service.webhooks.sender.resolved", lambda _: ["127.0.0.1"])
    authority, receiver = Authority.make("yard"), Receiver()
    (tmp_path / "ca.pem").write_bytes(authority.issued.certificate)
    sender = Sender(2.0, LOOPBACK, tmp_path / "ca.pem")
    body = b'{"id": "1", "subject": "a"}'

    async def send_to(host: str) -> Outcome:
        async with sender.client() as client:
            webhook = Webhook(id="mes", url=f"https://{host}:{receiver.port}/", secret=SECRET)
            return await sender.send(client, webhook, body)

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
