"""Trackables and location providers: what clients create, change and delete."""

from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest

from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from dropanchor_service.store.omlox_items import OmloxItems
from support.api import ask, kind_of
from support.omlox import OmloxBench

NIL = "00000000-0000-0000-0000-000000000000"


def test_each_tag_is_a_provider_and_has_a_trackable_of_its_own() -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1", "tag-2")
    assert bench.get("providers") == ["tag-1", "tag-2"]
    assert [one["id"] for one in bench.get("providers/summary")] == ["tag-1", "tag-2"]
    first, second = bench.get("trackables/summary")
    assert bench.get("trackables") == [first["id"], second["id"]]
    assert (first["type"], first["name"], first["location_providers"]) == ("omlox", "tag-1", ["tag-1"])
    assert bench.get(f"trackables/{first['id']}") == first
    assert [one["id"] for one in bench.get(f"trackables/{first['id']}/providers")] == ["tag-1"]


def test_a_name_is_the_name_of_the_tag_in_both_interfaces() -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1")
    trackable = bench.id_of("tag-1")
    put = bench.ask("PUT", f"trackables/{trackable}", json={"id": trackable, "type": "omlox", "name": "Forklift 3"})
    assert (put.status_code, put.json()["name"]) == (200, "Forklift 3")
    assert ask(bench.app, "GET", "/api/v1/tags/tag-1/settings").json()["name"] == "Forklift 3"
    assert bench.get("providers/tag-1")["name"] == "Forklift 3"
    assert bench.ask("PUT", "providers/tag-1", json={"id": "tag-1", "type": "uwb"}).status_code == 204
    assert bench.get(f"trackables/{trackable}")["name"] == "tag-1"
    assert bench.refusal("PUT", "providers/tag-1", json={"id": "tag-1", "type": "uwb", "name": "x" * 65})[1] == 400


def test_properties_of_clients_are_kept_through_a_restart_and_stand_beside_those_of_the_service(tmp_path: Path) -> None:
    bench = OmloxBench(folder=tmp_path)
    bench.poses.move("tag-1")
    trackable = bench.id_of("tag-1")
    shown = bench.get(f"trackables/{trackable}")
    body = shown | {"radius": 2.5, "properties": shown["properties"] | {"fleet": "north"}}
    assert bench.ask("PUT", f"trackables/{trackable}", json=body).status_code == 200
    provider = {"id": "tag-1", "type": "uwb", "sensors": {"battery": 3}, "properties": {"a": [1]}, "exit_delay": -1}
    assert bench.ask("PUT", "providers/tag-1", json=provider).status_code == 204
    bench.start()
    again = bench.get(f"trackables/{trackable}")
    assert (again["radius"], again["properties"]["fleet"]) == (2.5, "north")
    assert again["properties"]["dropanchor"]["tags"][0]["state"] == "tracking"
    kept = bench.get("providers/tag-1")
    assert (kept["sensors"], kept["properties"]["a"], kept["exit_delay"]) == ({"battery": 3}, [1], -1)
    assert "dropanchor" not in (tmp_path / "omlox_tag_trackables.json").read_text()
    assert bench.get("trackables/motions")[0]["properties"]["fleet"] == "north"


def test_a_trackable_of_a_client_takes_its_tags_and_shows_the_one_that_is_known_best(tmp_path: Path) -> None:
    bench = OmloxBench(folder=tmp_path)
    bench.poses.move("tag-1", x=1.0, cov=0.5)
    bench.poses.move("tag-2", x=2.0, cov=0.1)
    body = {"id": NIL, "type": "virtual", "name": "Truck", "location_providers": ["tag-1", "tag-2"]}
    made = bench.ask("POST", "trackables", json=body)
    assert made.status_code == 201
    identifier = made.json()["id"]
    assert identifier != NIL
    bench.start()
    assert bench.get("trackables") == [identifier]
    assert {tag: bench.id_of(tag) for tag in ("tag-1", "tag-2")} == {"tag-1": identifier, "tag-2": identifier}
    (motion,) = bench.get("trackables/motions", crs="local")
    assert (motion["id"], motion["location"]["provider_id"]) == (identifier, "tag-2")
    assert bench.get(f"trackables/{identifier}/location")["provider_id"] == "tag-2"
    assert len(bench.get(f"trackables/{identifier}/locations")) == 2
    refused = bench.refusal("POST", "trackables", json=body | {"location_providers": ["tag-2"]})
    assert refused[:2] == ("provider-assigned", 409)
    assert bench.ask("DELETE", f"trackables/{identifier}").status_code == 204
    assert bench.refusal("GET", f"trackables/{identifier}")[:2] == ("unknown-trackable", 404)
    assert len(bench.get("trackables")) == 2


def test_what_cannot_be_done_to_a_trackable_is_refused_with_a_reason() -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1")
    own = bench.id_of("tag-1")
    body = {"type": "virtual", "location_providers": ["tag-1", "x"]}
    assert bench.refusal("PUT", f"trackables/{own}", json=body)[0] == "stands-for-a-tag"
    assert bench.refusal("DELETE", f"trackables/{own}")[0] == "stands-for-a-tag"
    assert bench.refusal("POST", "trackables", json={"id": own, "type": "omlox"})[0] == "exists-already"
    assert bench.refusal("PUT", f"trackables/{own}", json={"id": str(uuid4()), "type": "omlox"})[0] == "id-differs"
    assert bench.refusal("PUT", f"trackables/{uuid4()}", json={"type": "omlox"})[0] == "unknown-trackable"
    assert bench.refusal("GET", "trackables/tag-1")[:2] == ("invalid-request", 400)
    assert bench.refusal("POST", "trackables", json={"name": "no type"})[:2] == ("invalid-request", 400)


def test_deleting_all_trackables_leaves_those_of_the_tags() -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1")
    own = bench.id_of("tag-1")
    bench.ask("POST", "trackables", json={"type": "virtual"})
    assert len(bench.get("trackables")) == 2
    assert bench.ask("DELETE", "trackables").status_code == 204
    assert bench.get("trackables") == [own]


def test_a_trackable_without_tags_has_no_location() -> None:
    bench = OmloxBench()
    identifier = bench.ask("POST", "trackables", json={"type": "virtual"}).json()["id"]
    kind, _, message = bench.refusal("GET", f"trackables/{identifier}/location")
    assert (kind, "location_providers" in message) == ("no-location", True)


def test_a_provider_can_be_registered_and_deleted(tmp_path: Path) -> None:
    bench = OmloxBench(folder=tmp_path)
    body = {"id": "a/b", "type": "uwb", "name": "Cart", "properties": {"a": 1}}
    assert bench.ask("POST", "providers", json=body).status_code == 201
    assert bench.refusal("POST", "providers", json=body)[0] == "exists-already"
    assert bench.get("providers/a%2Fb")["name"] == "Cart"
    assert ask(bench.app, "GET", "/api/v1/tags/a%2Fb").status_code == 200
    assert bench.ask("DELETE", "providers/a%2Fb").status_code == 204
    assert bench.get("providers") == []
    assert bench.refusal("GET", "providers/a%2Fb")[0] == "unknown-tag"
    bench.poses.move("a/b")
    assert "a" not in bench.get("providers/a%2Fb")["properties"]


@pytest.mark.parametrize("path", ["providers/tag-1/location", "providers/locations", "providers/tag-1/proximity"])
def test_positions_of_others_are_refused(path: str) -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1")
    assert bench.refusal("PUT", path, json={})[:2] == ("not-offered", 403)
    assert bench.refusal("POST", "providers", json={"id": "b", "type": "gps"})[:2] == ("not-offered", 403)


def test_the_limit_of_tags_holds_here_too() -> None:
    bench = OmloxBench()
    bench.app = bench.poses.app(max_tags=1, omlox=OmloxItems.opened(None))
    assert bench.ask("POST", "providers", json={"id": "a", "type": "uwb"}).status_code == 201
    assert bench.refusal("POST", "providers", json={"id": "b", "type": "uwb"})[0] == "tags-full"


def test_keys_allow_here_what_they_allow_in_our_own_interface(tmp_path: Path) -> None:
    keys = ApiKeys(tmp_path)
    bench = OmloxBench(authenticator=Authenticator({SOURCE: keys}))
    bench.poses.move("tag-1")
    reader, writer, admin = (keys.add(scope.word, scope) for scope in Scope)
    tag = keys.add_for_tag("phone", "tag-1")

    def status(secret: str, method: str, path: str, **options: Any) -> int:
        headers = {"authorization": f"Bearer {secret}"} if secret else {}
        return bench.ask(method, path, headers=headers, **options).status_code

    fence = {"region": {"type": "Point", "coordinates": [13.4, 52.5]}, "radius": 5}
    assert [status(secret, "GET", "providers") for secret in ("", "x", tag, reader)] == [401, 401, 403, 200]
    assert [status(secret, "POST", "fences", json=fence) for secret in (reader, writer)] == [403, 201]
    assert [status(secret, "DELETE", "fences") for secret in (writer, admin)] == [403, 204]
    assert status("", "GET", "openapi.json") == 200
    refused = bench.ask("GET", "providers")
    assert kind_of(refused) == "unauthenticated"
    assert refused.json()["code"] == 401


def test_a_body_without_content_type_is_read_as_json_but_not_from_another_page() -> None:
    bench = OmloxBench(cors_origins=("https://map.example",))
    body = b'{"type": "virtual", "name": "Truck"}'

    def created(**headers: str) -> int:
        return bench.ask("POST", "trackables", content=body, headers=headers).status_code

    assert created() == 201
    assert created(origin="https://evil.example") == 403
    assert created(origin="https://map.example") == 201
    assert created(origin="http://test") == 201
    assert len(bench.get("trackables")) == 3


def nested(levels: int) -> str:
    return '{"a":' * levels + "1" + "}" * levels


@pytest.mark.parametrize(
    "properties",
    [
        nested(40),
        nested(900),
        nested(100_000),
        '{"a": 123456789012345678901234567890}',
        r'{"a": "\ud800"}',
        '{"a": "%s"}',
    ],
)
def test_properties_that_cannot_be_returned_are_refused_and_harm_no_other_object(properties: str) -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1")
    text = properties.replace("%s", "x" * 70_000)
    body = '{"id": "tag-1", "type": "uwb", "region": {"type": "Point", "coordinates": [13.4, 52.5]}, "radius": 5, '
    headers = {"content-type": "application/json"}
    for method, path in (("PUT", "providers/tag-1"), ("POST", "fences"), ("POST", "trackables")):
        known = body if path.startswith("providers") else body.replace('"id": "tag-1", ', "").replace("uwb", "omlox")
        found = bench.refusal(method, path, content=f'{known}"properties": {text}}}', headers=headers)
        assert found[:2] == ("invalid-request", 400)
    assert len(bench.get("trackables/summary")) == len(bench.get("providers/summary")) == 1
    assert bench.get("fences/summary") == []
