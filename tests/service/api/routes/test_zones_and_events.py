"""Zones, rules, events and webhooks over REST."""

import ipaddress
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from prometheus_client import CollectorRegistry

from dropanchor_schemas.events import EventList, EventType
from dropanchor_service.api import create_app
from dropanchor_service.api.http.access import required_scope
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.api.routes.event_parts import EventParts
from dropanchor_service.events.drafts import Draft, StateKey, StateValue
from dropanchor_service.security.identity import Scope
from dropanchor_service.webhooks.registry import FILE_NAME, open_webhooks
from dropanchor_service.webhooks.sender import Sender
from dropanchor_service.zones.items import ZoneItems
from support.api import ApiBench, ask, kind_of, make_api_bench
from support.http_server import running_server
from support.receiver import Receiver, running_receiver

ZONE, RULE, SECRET = examples.ZONE, examples.RULE, examples.SECRET


def app_of(parts: EventParts, bench: ApiBench | None = None) -> FastAPI:
    bench = bench or make_api_bench()
    return create_app(
        bench.answers,
        ready=lambda: (True, []),
        registry=CollectorRegistry(),
        stopping=bench.stopping,
        receive=lambda *_: None,
        receive_health=lambda *_: None,
        dashboard=None,
        events=parts,
    )


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
    assert kind_of(ask(app, "GET", "/api/v1/events", params={"after": "x"})) == "invalid-request"
    assert kind_of(ask(app, "GET", "/api/v1/events?after=1&after=2")) == "invalid-request"


def test_a_stream_begins_after_the_last_id_and_goes_on_with_new_events() -> None:
    parts, bench = EventParts.in_memory("yard"), make_api_bench()
    happen(parts, "a", "b", "a")
    with running_server(app_of(parts, bench), bench.stopping) as port, httpx.Client(timeout=30.0) as client:
        url, headers = f"http://127.0.0.1:{port}/api/v1/events/stream?tags=a", {"last-event-id": "1"}
        with client.stream("GET", url, headers=headers) as stream:
            lines = (line for line in stream.iter_lines() if line.startswith("id: "))
            assert next(lines) == f"id: {3:020}"
            happen(parts, "b", "a")
            assert next(lines) == f"id: {5:020}"
        bench.stopping.set()


def webhook(**changes: Any) -> dict[str, Any]:
    return {"id": "mes", "url": "http://127.0.0.1:9/", "secret": SECRET} | changes


def test_the_tags_in_each_known_zone_are_counted_from_entry_to_exit() -> None:
    parts = EventParts.in_memory("yard")
    app = app_of(parts)
    ask(app, "PUT", "/api/v1/zones/dock", json=ZONE)
    inside, outside = StateValue(1, 5), None
    states = {StateKey("zone", zone, tag): inside for zone in ("dock", "deleted") for tag in ("a", "b")}
    parts.store.commit([], {**states, StateKey("rule", "dock", "c"): inside})
    assert ask(app, "GET", "/api/v1/zone-occupancy").json() == {"zones": [{"zone": "dock", "tags": 2}]}
    parts.store.commit([], {StateKey("zone", "dock", "a"): outside})
    assert ask(app, "GET", "/api/v1/zone-occupancy").json() == {"zones": [{"zone": "dock", "tags": 1}]}
    parts.store.commit([], {StateKey("zone", "dock", "b"): outside})
    assert ask(app, "GET", "/api/v1/zone-occupancy").json() == {"zones": []}


def with_loopback(folder: Path | None = None) -> EventParts:
    sender = Sender(2.0, [ipaddress.ip_network("127.0.0.0/8")])
    return replace(EventParts.in_memory("yard"), sender=sender, webhooks=open_webhooks(folder))


def test_a_webhook_never_returns_its_secret_and_keeps_it(tmp_path: Path) -> None:
    parts = with_loopback(tmp_path)
    app = app_of(parts)
    made = ask(app, "PUT", "/api/v1/webhooks/mes", json=webhook())
    assert made.json()["has_secret"] is True
    changed = ask(app, "PUT", "/api/v1/webhooks/mes", json=webhook(secret=None, tags=["a"]))
    answers = [made, changed, *(ask(app, "GET", f"/api/v1/webhooks{path}") for path in ("", "/mes"))]
    assert all(response.status_code == 200 and SECRET not in response.text for response in answers)
    again = ask(
        app, "PUT", "/api/v1/webhooks/mes", json=webhook(url="http://127.0.0.1:8/"), headers={"if-none-match": "*"}
    )
    assert kind_of(again) == "changed-meanwhile"
    assert parts.webhooks.all["mes"].url == "http://127.0.0.1:9/"
    assert parts.webhooks.all["mes"].secret == SECRET
    assert open_webhooks(tmp_path).all["mes"].secret == SECRET
    assert (tmp_path / FILE_NAME).stat().st_mode & 0o077 == 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"url": "http://10.0.0.1/"}, "allow_networks"),
        ({"url": "http://169.254.169.254/"}, "allow_networks"),
        ({"url": "ftp://example.com/"}, "https://"),
        ({"url": "https://me:word@example.com/"}, "password"),
        ({"secret": None}, "needs a secret"),
        ({"secret": "whsec_c2hvcnQ="}, "openssl"),
    ],
)
def test_a_webhook_that_cannot_work_is_refused_with_a_sentence(change: Mapping[str, Any], words: str) -> None:
    response = ask(app_of(with_loopback()), "PUT", "/api/v1/webhooks/mes", json=webhook(**change))
    assert kind_of(response) == "webhook-refused"
    assert words in response.json()["detail"]
    assert SECRET not in response.text


def test_a_test_event_says_what_the_receiver_answered() -> None:
    app, receiver = app_of(with_loopback()), Receiver()
    with running_receiver(receiver):
        ask(app, "PUT", "/api/v1/webhooks/mes", json=webhook(url=receiver.url))
        tested = ask(app, "POST", "/api/v1/webhooks/mes/test").json()
    assert tested == {"delivered": True, "detail": "the receiver answered 200 OK"}
    assert receiver.accepted[0]["type"] == "dropanchor.webhook.test"
    failed = ask(app, "POST", "/api/v1/webhooks/mes/test").json()
    assert failed["delivered"] is False
    assert "ConnectError" in failed["detail"]


def test_dead_letters_are_listed_and_retried_and_go_with_their_webhook() -> None:
    parts = with_loopback()
    app = app_of(parts)
    ask(app, "PUT", "/api/v1/webhooks/mes", json=webhook())
    with parts.store.database.transaction() as connection:
        connection.executemany("INSERT INTO deliveries VALUES ('mes', ?, 0, ?)", [(1, "refused"), (2, None)])
    happen(parts, "a", "b")
    status = ask(app, "GET", "/api/v1/webhooks/mes").json()
    assert (status["pending"], status["dead"]) == (1, 1)
    letters = ask(app, "GET", "/api/v1/webhooks/mes/dead-letters").json()["dead_letters"]
    assert [(letter["event"]["subject"], letter["reason"]) for letter in letters] == [("a", "refused")]
    assert ask(app, "POST", "/api/v1/webhooks/mes/dead-letters/retry").json() == {"retried": 1}
    assert ask(app, "GET", "/api/v1/webhooks/mes").json()["pending"] == 2
    assert ask(app, "DELETE", "/api/v1/webhooks/mes").status_code == 204
    assert parts.deliveries.counts() == {}
    assert kind_of(ask(app, "POST", "/api/v1/webhooks/mes/test")) == "unknown-webhook"


def test_only_an_administrator_changes_a_webhook() -> None:
    assert required_scope("PUT", "/api/v1/webhooks/mes") is Scope.ADMIN
    assert required_scope("POST", "/api/v1/webhooks/mes/test") is Scope.ADMIN
    assert required_scope("GET", "/api/v1/webhooks") is Scope.READ
    assert required_scope("PUT", "/api/v1/zones/dock") is Scope.WRITE


def test_there_is_a_limit_of_webhooks() -> None:
    app = app_of(with_loopback())
    for number in range(20):
        path = f"/api/v1/webhooks/{number}"
        assert ask(app, "PUT", path, json=webhook(id=str(number))).status_code == 200
    assert kind_of(ask(app, "PUT", "/api/v1/webhooks/more", json=webhook(id="more"))) == "items-full"
