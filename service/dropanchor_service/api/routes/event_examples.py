"""Examples of the responses about zones, events and destinations, for the OpenAPI document."""

from typing import Any

ZONE: dict[str, Any] = {
    "tags": [],
    "groups": ["forklifts"],
    "id": "dock",
    "name": "Loading dock",
    "colour": "#2f6fde",
    "shape": {"type": "polygon", "points": [[0.0, 0.0], [12.0, 0.0], [12.0, 8.0], [0.0, 8.0]]},
    "enter": True,
    "exit": True,
    "dwell_s": 300.0,
    "speed_mps": 2.0,
    "enter_severity": "event",
    "dwell_severity": "event",
    "speed_severity": "alarm",
    "delay_s": 1.0,
    "muted_until_ns": None,
}
OCCUPANCY: dict[str, Any] = {"zones": [{"zone": "dock", "tags": 3}]}
RULE: dict[str, Any] = {
    "tags": [],
    "groups": ["forklifts"],
    "id": "apart",
    "name": "Keep apart",
    "type": "too_close",
    "severity": "warning",
    "distance_m": 3.0,
    "delay_s": 1.0,
    "muted_until_ns": None,
}
EVENT: dict[str, Any] = {
    "specversion": "1.0",
    "id": "5f0c1bb0c6a04f0f8f5a3c1a0c6d2e11",
    "source": "urn:dropanchor:site:default",
    "type": "dropanchor.zone.enter",
    "subject": "tag-1",
    "time": "2027-01-15T08:00:00.000000Z",
    "sequence": "00000000000000000042",
    "datacontenttype": "application/json",
    "data": {
        "t_ns": 1_800_000_000_000_000_000,
        "since_ns": 1_799_999_999_000_000_000,
        "zone": "dock",
        "rule": None,
        "name": "Loading dock",
        "x": 3.2,
        "y": 1.7,
        "probability": 0.998,
        "other_tag": None,
        "distance_m": None,
        "speed_mps": 1.1,
        "battery_fraction": None,
    },
}
ALARM: dict[str, Any] = {
    "id": EVENT["id"],
    "severity": "alarm",
    "began_ns": 1_799_999_999_000_000_000,
    "over_ns": None,
    "acknowledged": {
        "by": {"source": "key", "name": "anna"},
        "t_ns": 1_800_000_060_000_000_000,
        "note": "the driver has been told",
    },
    "muted_until_ns": None,
    "event": EVENT | {"data": EVENT["data"] | {"severity": "alarm"}},
}
EVENTS: dict[str, Any] = {"events": [EVENT], "next": None}
SECRET = "whsec_ZHJvcGFuY2hvci1leGFtcGxlLXNlY3JldC0wMQ=="
WEBHOOK: dict[str, Any] = {
    "id": "mes",
    "enabled": True,
    "types": ["dropanchor.zone.enter", "dropanchor.zone.exit"],
    "zones": ["dock"],
    "tags": [],
    "type": "webhook",
    "url": "https://mes.example.com/events",
    "secret": SECRET,
}
DESTINATION_STATE: dict[str, Any] = {
    "destination": WEBHOOK | {"url": "https://mes.example.com/…", "secret": None},
    "has_secret": True,
    "pending": 2,
    "oldest_ns": 1_800_000_000_000_000_000,
    "dead": 0,
    "problem": None,
}
DESTINATION_TEST: dict[str, Any] = {"delivered": True, "detail": "the receiver answered 200 OK"}
DEAD_LETTERS: dict[str, Any] = {"dead_letters": [{"event": EVENT, "reason": "the receiver answered 404 Not Found"}]}
