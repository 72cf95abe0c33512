"""A start that an operator tells wrongly makes no event while ranges deny it, and what it made is retracted."""

import signal
from pathlib import Path
from typing import Any

from dropanchor_schemas.wire import ENCODING_PACKED, Frame, encode_packed
from support.receiver import Receiver, running_receiver
from support.service import Running, running_service, settings_file, straight_north
from support.zenoh_router import wait_until

RAMP = {"id": "ramp", "delay_s": 0.0, "shape": {"type": "circle", "x": 10.0, "y": -12.0, "radius_m": 15.0}}
SECRET = "whsec_ZHJvcGFuY2hvci1leGFtcGxlLXNlY3JldC0wMQ=="
SETTINGS = '[delivery]\nallow_networks = ["127.0.0.0/8"]\nretry_s = 0.5\n'


def send(service: Running, tag: str, frame: Frame) -> None:
    answer = service.ask(
        "POST",
        f"/api/v1/ingest/samples?tag={tag}",
        content=encode_packed(frame),
        headers={"content-type": ENCODING_PACKED},
    )
    answer.raise_for_status()


def driving(farther_m: float = 0.0) -> Frame:
    """Return the samples of 8 s, until now, of a tag that drives north, with ranges that are longer by this."""
    frame = straight_north(80)
    ranges = [one._replace(range_m=one.range_m + farther_m) for one in frame.ranges]
    return Frame(ranges=ranges, headings=frame.headings)


def events(service: Running) -> list[tuple[str, str]]:
    found = service.get("/api/v1/events?since=0")["events"]
    return [(event["type"].removeprefix("dropanchor."), event["subject"]) for event in found]


def by_id(receiver: Receiver) -> dict[str, Any]:
    """Return each event once: after a kill, the last one that was sent may come again."""
    return {event["id"]: event for event in list(receiver.accepted)}


def test_a_wrong_start_makes_no_event_and_what_an_undone_one_made_is_retracted_after_a_kill(tmp_path: Path) -> None:
    receiver = Receiver()
    options = ("--config", str(settings_file(tmp_path, [], SETTINGS)), "--data-dir", str(tmp_path / "data"))
    start = {"x": 10.0, "y": -20.0, "heading_rad": 1.5707963, "std_m": 0.3}
    with running_receiver(receiver):
        with running_service(*options) as service:
            service.put("/api/v1/zones/ramp", RAMP)
            hook = {"type": "webhook", "url": receiver.url, "secret": SECRET, "types": ["dropanchor.zone.enter"]}
            service.put("/api/v1/destinations/mes", {"id": "mes", **hook})
            for tag in ("right", "wrong"):
                service.put(f"/api/v1/tags/{tag}/settings", {"start": start})
            send(service, "wrong", driving(farther_m=30.0))
            send(service, "right", driving())
            wait_until(lambda: events(service) == [("zone.enter", "right")])
            wait_until(lambda: "right" in receiver.subjects())
            service.stop(signal.SIGKILL)
        with running_service(*options) as service:
            assert service.get("/api/v1/zone-occupancy")["zones"] == [{"zone": "ramp", "tags": 1}]
            service.put("/api/v1/tags/right/settings", {"start": None})  # the operator's undo
            wait_until(lambda: len(by_id(receiver)) == 2)
            assert events(service) == [("zone.enter", "right"), ("event.retracted", "right")]
            assert service.get("/api/v1/zone-occupancy")["zones"] == []
    entered, retracted = by_id(receiver).values()
    assert (entered["type"], retracted["data"]["retracts"]) == ("dropanchor.zone.enter", entered["id"])
    assert retracted["data"]["reason"] == "start_taken_back"
