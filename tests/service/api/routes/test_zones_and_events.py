"""Zones, rules and events over REST."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from dropanchor_schemas.alarms import AlarmList
from dropanchor_schemas.events import Event, EventList
from dropanchor_schemas.zones import EventType
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.events.drafts import AlarmBegan, AlarmsOver, Draft, StateKey, StateValue
from dropanchor_service.zones.items import ZoneItems
from support.api import ask, kind_of, make_api_bench
from support.http_server import running_server

ZONE = examples.ZONE | {"z_min_m": None, "z_max_m": None}
RULE = examples.RULE


def app_of(parts: EventParts) -> FastAPI:
    return make_api_bench().app(events=parts)


def happen(parts: EventParts, *tags: str, zone: str = "dock", **data: Any) -> None:
    drafts = [Draft(EventType.ZONE_ENTER, tag, {"t_ns": 5, "since_ns": 4, "zone": zone, **data}) for tag in tags]
    parts.store.commit(drafts, {})


@pytest.mark.parametrize(
    ("path", "item", "unknown"),
    [("zones/dock", ZONE, "zone"), ("event-rules/apart", RULE, "rule")],
)
def test_an_item_is_made_read_changed_and_deleted_with_etags(path: str, item: dict[str, Any], unknown: str) -> None:
    app = app_of(EventParts.in_memory("yard"))
    collection, key = path.split("/")[0], {"zone": "zones", "rule": "rules"}[unknown]

    def put(name: str, **headers: str) -> Any:
        return ask(app, "PUT", f"/api/v1/{path}", json=item | {"name": name}, headers=headers)

    assert kind_of(ask(app, "GET", f"/api/v1/{path}")) == f"unknown-{unknown}"
    assert kind_of(put("one", **{"if-match": "*"})) == "changed-meanwhile"
    made = put("one")
    assert made.json() == item | {"name": "one"}
    etag = made.headers["etag"]
    assert ask(app, "GET", f"/api/v1/{path}").headers["etag"] == etag
    assert kind_of(put("two", **{"if-none-match": "*"})) == "changed-meanwhile"
    assert put("two", **{"if-match": etag}).status_code == 200
    assert kind_of(put("three", **{"if-match": etag})) == "changed-meanwhile"
    assert ask(app, "GET", f"/api/v1/{collection}").json() == {key: [item | {"name": "two"}]}
    assert kind_of(ask(app, "DELETE", f"/api/v1/{path}", headers={"if-match": etag})) == "changed-meanwhile"
    assert ask(app, "DELETE", f"/api/v1/{path}").status_code == 204
    assert kind_of(ask(app, "DELETE", f"/api/v1/{path}")) == f"unknown-{unknown}"
    assert put("again", **{"if-none-match": "*"}).status_code == 200
    assert kind_of(ask(app, "PUT", f"/api/v1/{path}-2", json=item)) == "id-differs"


def test_what_was_saved_is_there_after_a_restart(tmp_path: Path) -> None:
    app = app_of(replace(EventParts.in_memory("yard"), items=ZoneItems.opened(tmp_path)))
    for path, item in (("zones/dock", ZONE), ("event-rules/apart", RULE)):
        assert ask(app, "PUT", f"/api/v1/{path}", json=item).status_code == 200
    app = app_of(replace(EventParts.in_memory("yard"), items=ZoneItems.opened(tmp_path)))
    assert ask(app, "GET", "/api/v1/zones/dock").json() == ZONE
    assert ask(app, "GET", "/api/v1/event-rules/apart").json() == RULE


@pytest.mark.parametrize(
    ("change", "kind", "words"),
    [
        ({"shape": {"type": "polygon", "points": [[0, 0], [4, 4], [4, 0], [0, 4]]}}, "shape-refused", "cross"),
        ({"shape": {"type": "polygon", "points": [[0, 0], [4, 4]]}}, "invalid-request", "at least 3"),
        ({"shape": {"type": "polygon", "points": [[0, 0]] * 500}}, "invalid-request", "at most 200"),
        ({"shape": {"type": "polygon", "points": [[0, 0], [1e9, 0], [0, 1e9]]}}, "invalid-request", "100000"),
        ({"shape": {"type": "circle", "x": 0, "y": 0, "radius_m": 1e6}}, "invalid-request", "10000"),
        ({"shape": {"type": "circle", "x": 0, "y": 0, "radius_m": 0}}, "invalid-request", "0.1"),
        ({"shape": {"type": "star"}}, "invalid-request", "polygon"),
        ({"colour": "red"}, "invalid-request", "colour"),
        ({"groups": [""]}, "invalid-request", "groups"),
        ({"dwell_s": -1}, "invalid-request", "dwell_s"),
        ({"surprise": 1}, "invalid-request", "unknown"),
    ],
)
def test_a_bad_zone_is_refused_with_a_sentence(change: dict[str, Any], kind: str, words: str) -> None:
    parts = EventParts.in_memory("yard")
    response = ask(app_of(parts), "PUT", "/api/v1/zones/dock", json=ZONE | change)
    assert kind_of(response) == kind
    assert words in response.json()["detail"]
    assert not parts.items.zones.all


def test_events_come_in_pages_and_by_filter() -> None:
    parts = EventParts.in_memory("yard")
    app = app_of(parts)
    happen(parts, "a", "b", "a", "c", "a")

    def found(**query: Any) -> EventList:
        return EventList.model_validate(ask(app, "GET", "/api/v1/events", params=query).json())

    assert [event.subject for event in found(limit=2).events] == ["c", "a"]
    first = found(limit=2, since=0)
    assert [event.subject for event in first.events] == ["a", "b"]
    second = found(limit=2, after=first.next)
    assert [int(event.sequence) for event in second.events] == [3, 4]
    last = found(limit=2, after=second.next)
    assert ([int(event.sequence) for event in last.events], last.next) == ([5], None)
    assert len(found(tags="a,c").events) == 4
    assert found(types="dropanchor.zone.exit").events == []
    assert found(zones="gate").events == []
    assert found(since=6).events == []
    assert found(to=4).events == []
    assert [int(event.sequence) for event in found(limit=2, before=4).events] == [2, 3]
    table = ask(app, "GET", "/api/v1/events/file", params={"tags": "a", "since": 5, "to": 5}).text.splitlines()
    assert [line.split(",")[0] for line in table] == ["sequence", *(f"{number:020}" for number in (1, 3, 5))]
    lines = ask(app, "GET", "/api/v1/events/file?format=jsonl&types=dropanchor.zone.enter").text.splitlines()
    assert [Event.model_validate_json(line).subject for line in lines] == ["a", "b", "a", "c", "a"]
    assert kind_of(ask(app, "GET", "/api/v1/events", params={"after": "x"})) == "invalid-request"
    assert kind_of(ask(app, "GET", "/api/v1/events?after=1&after=2")) == "invalid-request"


def test_alarms_are_listed_and_acknowledged_and_the_trail_names_who_did() -> None:
    parts = EventParts.in_memory("yard")
    app = app_of(parts)
    ask(app, "PUT", "/api/v1/zones/dock", json=ZONE | {"muted_until_ns": 7})
    for tag in ("a", "b"):
        key = StateKey("zone", "dock", tag)
        data = {"t_ns": 5, "since_ns": 4, "zone": "dock", "severity": "alarm"}
        parts.store.commit([Draft(EventType.ZONE_ENTER, tag, data, AlarmBegan(key, 1))], {})

    def listed(**query: Any) -> list[str]:
        found = AlarmList.model_validate(ask(app, "GET", "/api/v1/alarms", params=query).json())
        return [f"{one.event.subject} {one.over_ns} {one.muted_until_ns}" for one in found.alarms]

    assert listed() == ["b None 7", "a None 7"]
    parts.store.commit([AlarmsOver(StateKey("zone", "dock", "b"), 1, 9, is_muted=False)], {})
    assert (listed(), listed(state="open")) == (["b 9 7", "a None 7"], ["a None 7"])
    page = ask(app, "GET", "/api/v1/alarms?limit=1").json()
    assert listed(before=page["next"]) == listed(tags="a") == ["a None 7"]
    (alarm,) = page["alarms"]
    path = f"/api/v1/alarms/{alarm['id']}/acknowledgement"
    for note in ("seen", "the driver knows"):
        answer = ask(app, "PUT", path, json={"note": note}).json()
        assert (answer["acknowledged"]["by"], answer["acknowledged"]["note"]) == ({"source": "local", "name": ""}, note)
    assert (listed(), listed(state="all")) == (["a None 7"], ["b 9 7", "a None 7"])
    second, first = ask(app, "GET", "/api/v1/audit?kind=alarm").json()["entries"]
    assert (first["before"], second["before"]["note"], second["item"]) == (None, "seen", alarm["id"])
    told = EventList.model_validate(ask(app, "GET", "/api/v1/events").json()).events[-1]
    assert (told.type, told.data.alarm, told.data.note) == (
        EventType.ALARM_ACKNOWLEDGED,
        alarm["id"],
        "the driver knows",
    )
    assert kind_of(ask(app, "PUT", "/api/v1/alarms/x/acknowledgement", json={})) == "unknown-alarm"
    assert kind_of(ask(app, "PUT", path, json={"note": 1})) == "invalid-request"


def test_a_stream_begins_after_the_last_id_and_goes_on_with_new_events() -> None:
    parts, bench = EventParts.in_memory("yard"), make_api_bench()
    happen(parts, "a", "b", "a")
    with running_server(bench.app(events=parts), bench.stopping) as port, httpx.Client() as client:
        url, headers = f"http://127.0.0.1:{port}/api/v1/events/stream?tags=a", {"last-event-id": "1"}
        with client.stream("GET", url, headers=headers) as stream:
            lines = (line for line in stream.iter_lines() if line.startswith("id: "))
            assert next(lines) == f"id: {3:020}"
            happen(parts, "b", "a")
            assert next(lines) == f"id: {5:020}"
        bench.stopping.set()


def test_the_tags_in_each_known_zone_are_counted_from_entry_to_exit() -> None:
    parts = EventParts.in_memory("yard")
    app = app_of(parts)
    ask(app, "PUT", "/api/v1/zones/dock", json=ZONE)
    inside, outside = StateValue(1, 5), None
    states = {StateKey("zone", zone, tag): inside for zone in ("dock", "deleted") for tag in ("a", "b")}
    states[StateKey("zone", "dock", "b")] = StateValue(1, 3)
    parts.store.commit([], {**states, StateKey("rule", "dock", "c"): inside})
    assert ask(app, "GET", "/api/v1/zone-occupancy").json() == {"zones": [{"zone": "dock", "tags": 2}]}
    assert ask(app, "GET", "/api/v1/zone-occupancy?names=true").json()["zones"][0]["inside"] == [
        {"tag": "b", "since_ns": 3},
        {"tag": "a", "since_ns": 5},
    ]
    parts.store.commit([], {StateKey("zone", "dock", "a"): outside})
    assert ask(app, "GET", "/api/v1/zone-occupancy").json() == {"zones": [{"zone": "dock", "tags": 1}]}
    parts.store.commit([], {StateKey("zone", "dock", "b"): outside})
    assert ask(app, "GET", "/api/v1/zone-occupancy").json() == {"zones": []}
