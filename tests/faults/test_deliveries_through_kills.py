"""Events of a killed service: nothing stored is lost, nothing is invented, and destinations get everything in order.

DROPANCHOR_RECEIVER_DOWN_S sets for how long the receiver is down.
"""

import os
import signal
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import httpx
import orjson
import zenoh

from dropanchor_schemas.keys import all_tags
from support.mail_server import MailServer, running_mail_server
from support.patience import PATIENCE_S
from support.receiver import Receiver, running_receiver
from support.service import Running, running_service
from support.zenoh_router import free_endpoint, free_port, wait_until

TAGS = [f"tag-{number}" for number in range(10)]
NAMES = {"tag-0": "Cart"}
DOWN_S = float(os.environ.get("DROPANCHOR_RECEIVER_DOWN_S", "5"))
SECRET = "whsec_ZHJvcGFuY2hvci1leGFtcGxlLXNlY3JldC0wMQ=="
NEAR_M, FAR_M = 4.0, 40.0
WEST = {"id": "west", "shape": {"type": "circle", "x": 0.0, "y": 0.0, "radius_m": 20.0}, "delay_s": 0.5}


def settings(folder: Path) -> Path:
    file = folder / "dropanchor.toml"
    file.write_text(
        'engine = "paper"\n[delivery]\nallow_networks = ["127.0.0.0/8"]\nretry_s = 0.5\n[[site.anchors]]\nid = "7"\n'
    )
    return file


def start_at(service: Running, x: float) -> None:
    """Put all tags at this place: their estimators start again there."""
    for tag in TAGS:
        start = {"x": x, "y": 0.0, "heading_rad": 0.0, "std_m": 0.05}
        service.put(f"/api/v1/tags/{tag}/settings", {"name": NAMES.get(tag, ""), "start": start})


def stand(service: Running, x: float, until: Any, timeout_s: float = PATIENCE_S) -> None:
    """Send samples of all tags, which stand there, until the condition holds."""
    end_s = time.monotonic() + timeout_s
    with httpx.Client(base_url=service.url, trust_env=False, verify=False) as client:
        while not until():
            assert time.monotonic() < end_s, "the condition did not come true"
            for tag in TAGS:
                samples = standing(time.time_ns(), x)
                client.post("/api/v1/ingest/samples", params={"tag": tag}, json=samples).raise_for_status()
            time.sleep(0.05)  # the rate of the samples


def standing(t_ns: int, x: float) -> dict[str, Any]:
    return {
        "imu": [{"t_ns": t_ns, "acc": [0, 0, 9.81], "gyro": [0, 0, 0], "mag": [20, 0, -40]}],
        "range": [{"t_ns": t_ns, "anchor": 7, "range_m": x, "std_m": 0.05}],
        "heading": [{"t_ns": t_ns, "heading_rad": 0.0, "std_rad": 0.05}],
    }


def stored(service: Running) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = service.get("/api/v1/events?since=0&limit=1000")["events"]
    return found


def of_kind(service: Running, kind: str) -> int:
    return sum(event["type"] == f"dropanchor.zone.{kind}" for event in stored(service))


def test_events_and_alarms_survive_two_kills_and_a_receiver_that_is_down(tmp_path: Path) -> None:
    receiver, data = Receiver(port=free_port()), tmp_path / "data"
    options = ("--config", str(settings(tmp_path)), "--data-dir", str(data))
    with running_service(*options) as service:
        service.put("/api/v1/zones/west", WEST | {"enter_severity": "alarm"})
        service.put("/api/v1/destinations/mes", {"type": "webhook", "id": "mes", "url": receiver.url, "secret": SECRET})
        start_at(service, NEAR_M)
        stand(service, NEAR_M, lambda: of_kind(service, "enter") == len(TAGS))
        seen = service.get("/api/v1/alarms")["alarms"][0]["id"]
        service.put(f"/api/v1/alarms/{seen}/acknowledgement", {"note": "is watched"})
        before, alarms = stored(service), service.get("/api/v1/alarms")
        assert (len(before), len(alarms["alarms"])) == (len(TAGS) + 1, len(TAGS))
        service.stop(signal.SIGKILL)
    with running_service(*options) as service:
        assert stored(service) == before
        stand(service, NEAR_M, after(3.0))
        assert stored(service) == before  # the tags are inside, as before the kill
        assert service.get("/api/v1/alarms") == alarms
        start_at(service, FAR_M)
        stand(service, FAR_M, lambda: of_kind(service, "exit") == len(TAGS))
        time.sleep(DOWN_S)
        service.stop(signal.SIGKILL)
    with running_service(*options) as service, running_receiver(receiver):
        wait_until(lambda: len({event["id"] for event in receiver.accepted}) == 3 * len(TAGS) + 1)
        wait_until(lambda: service.get("/api/v1/destinations/mes")["pending"] == 0)
        everything = stored(service)
        ended = service.get("/api/v1/alarms")["alarms"]
    first = {event["id"]: event for event in reversed(receiver.accepted)}
    assert first == {event["id"]: event for event in everything}
    by_tag: dict[str, list[str]] = defaultdict(list)
    for event in {event["id"]: event for event in receiver.accepted}.values():
        by_tag[event["subject"]].append(event["type"].rpartition(".")[2])
    expected = {tag: ["enter", "over", "exit"] for tag in TAGS}
    expected[everything[len(TAGS)]["subject"]].insert(1, "acknowledged")
    assert by_tag == expected
    assert len(ended) == len(TAGS) - 1  # nobody has acknowledged these
    assert all(alarm["over_ns"] is not None for alarm in ended)


def after(seconds: float) -> Any:
    end_s = time.monotonic() + seconds
    return lambda: time.monotonic() >= end_s


def test_a_kill_while_events_are_delivered_repeats_some_and_loses_none(tmp_path: Path) -> None:
    receiver = Receiver(port=free_port())
    options = ("--config", str(settings(tmp_path)), "--data-dir", str(tmp_path / "data"))
    with running_receiver(receiver):
        with running_service(*options) as service:
            service.put("/api/v1/zones/west", WEST)
            service.put(
                "/api/v1/destinations/mes", {"type": "webhook", "id": "mes", "url": receiver.url, "secret": SECRET}
            )
            receiver.release.clear()
            start_at(service, NEAR_M)
            stand(service, NEAR_M, lambda: of_kind(service, "enter") == len(TAGS))
            wait_until(lambda: receiver.arrived > 0)
            service.stop(signal.SIGKILL)  # requests are on their way, and none is answered
        receiver.release.set()
        with running_service(*options) as service:
            wait_until(lambda: service.get("/api/v1/destinations/mes")["pending"] == 0)
            ids = {event["id"] for event in stored(service)}
    assert {event["id"] for event in receiver.accepted} == ids
    assert len(ids) == len(TAGS)
    assert len(receiver.accepted) > len(TAGS)


def test_mails_that_a_kill_interrupts_come_after_the_restart(tmp_path: Path) -> None:
    server = MailServer(answer="451 not now")
    file = settings(tmp_path)
    file.write_text(f'{file.read_text()}[email]\nserver = "127.0.0.1"\nport = {server.port}\ntls = "none"\n')
    options = ("--config", str(file), "--data-dir", str(tmp_path / "data"))
    with running_mail_server(server):
        with running_service(*options) as service:
            service.put("/api/v1/zones/west", WEST)
            shift = {"type": "email", "id": "shift", "to": ["shift@example.com"], "digest_s": 0}
            service.put("/api/v1/destinations/shift", shift)
            start_at(service, NEAR_M)
            stand(service, NEAR_M, lambda: of_kind(service, "enter") == len(TAGS))
            wait_until(lambda: server.attempts > 0)
            service.stop(signal.SIGKILL)
        server.answer = "250 OK"
        with running_service(*options) as service:
            wait_until(lambda: service.get("/api/v1/destinations/shift")["pending"] == 0)
    said = [line for mail in server.mails for line in mail.get_content().splitlines() if " entered " in line]
    assert sorted(said) == sorted(["Cart (tag-0) entered west.", *(f"{tag} entered west." for tag in TAGS[1:])])


def test_events_come_over_zenoh_in_the_order_of_the_store(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with running_service("--config", str(settings(tmp_path)), endpoint=endpoint) as service:
        config = zenoh.Config.from_json5(
            orjson.dumps({"mode": "client", "connect": {"endpoints": [endpoint]}}).decode()
        )
        got: list[dict[str, Any]] = []
        with zenoh.open(config) as session:
            session.declare_subscriber(
                all_tags("default", "event"), lambda sample: got.append(orjson.loads(sample.payload.to_bytes()))
            )
            service.put("/api/v1/zones/west", WEST)
            start_at(service, NEAR_M)
            stand(service, NEAR_M, lambda: len(got) >= len(TAGS))
            assert got == stored(service)
        assert service.metric("dropanchor_events_total") == len(TAGS)
