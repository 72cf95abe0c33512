"""Who changed what: each route that writes leaves an entry, without secrets, for those who may read it."""

import csv
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from dropanchor_schemas.audit import AuditKind, AuditList
from dropanchor_schemas.shares import ShareRequest
from dropanchor_schemas.site import Georeference, TagSettings
from dropanchor_schemas.zones import EventType
from dropanchor_service.api.omlox.routes.fences import EXAMPLE as FENCE
from dropanchor_service.api.routes import event_examples
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.events.drafts import AlarmBegan, Draft, StateKey
from dropanchor_service.security import api_keys, share_links
from dropanchor_service.security.api_keys import ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from dropanchor_service.security.share_links import ShareLinks
from dropanchor_service.store.omlox_items import OmloxItems
from support.api import T_NS, ApiBench, ask, kind_of, make_api_bench
from support.interface_document import DOCUMENT
from support.plan_files import image_file

NO_CHANGE = {
    **dict.fromkeys(("ingest_samples", "ingest_sensor_logger", "ingest_phyphox", "ingest_health"), "data of tags"),
    **dict.fromkeys(("start_recording", "stop_recording"), "no setting, and it must stop with a full disk"),
    **dict.fromkeys(("retry_dead_letters", "delete_dead_letters"), "events that wait are no settings"),
    "run_again": "it changes nothing",
    "start_simulated_tags": "the start of each tag leaves an entry",
    **dict.fromkeys(("stop_simulated_tags", "make_qr_code"), "no setting"),
    "test_destination": "it sends an event and changes nothing",
}
"""Operations that write but change no settings, and why."""
ORDER = ("post", "put", "patch", "delete")


@dataclass
class Audited:
    """An interface with access control. secrets: a key for each scope, and a share link."""

    app: FastAPI
    bench: ApiBench
    secrets: dict[str, str]

    def ask(self, method: str, path: str, by: str = "admin", **options: Any) -> httpx.Response:
        headers = {"authorization": f"Bearer {self.secrets[by]}"} | options.pop("headers", {})
        return ask(self.app, method, path, headers=headers, **options)

    def entries(self, by: str = "admin", **query: Any) -> list[dict[str, Any]]:
        answer = self.ask("GET", "/api/v1/audit", by, params=query).raise_for_status().json()
        AuditList.model_validate(answer)
        found: list[dict[str, Any]] = answer["entries"]
        return found

    def put(self, path: str, body: Any, by: str = "admin") -> None:
        self.ask("PUT", f"/api/v1/{path}", by, json=body).raise_for_status()


@pytest.fixture
def audited(tmp_path: Path) -> Audited:
    keys, links = ApiKeys(tmp_path), ShareLinks(tmp_path, clock=lambda: T_NS / 1e9)
    bench = make_api_bench()
    bench.move("tag-1")
    secrets = {scope.word: keys.add(scope.word, scope) for scope in Scope}
    secrets["link"] = links.add("default", ShareRequest())[1]
    authenticator = Authenticator({share_links.SOURCE: links, api_keys.SOURCE: keys})
    events = EventParts.in_memory("default", lambda: bench.now_ns)
    lost = {"t_ns": T_NS, "since_ns": T_NS, "rule": "lost", "severity": "alarm"}
    alarm = AlarmBegan(StateKey("rule", "lost", "tag-1"), 1)
    events.store.commit([Draft(EventType.TAG_LOST, "tag-1", lost, alarm)], {})
    app = bench.app(authenticator=authenticator, omlox=OmloxItems.opened(None), events=events)
    return Audited(app, bench, secrets)


def writing() -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield method, path and description of each operation that writes, in an order in which their examples work."""
    found = [
        (method, path, operation)
        for path, item in DOCUMENT["paths"].items()
        for method, operation in item.items()
        if method in ORDER and "/sites/{site}/" not in path
    ]
    yield from sorted(found, key=lambda one: ORDER.index(one[0]))


def example_of(operation: dict[str, Any], made: dict[str, Any]) -> dict[str, Any]:
    """Return the content of a request, with what the service made before where the example names it."""
    if operation["operationId"] == "upload_plan_image":
        return {"content": image_file(), "headers": {"content-type": "image/png"}}
    if "requestBody" not in operation:
        return {}
    content = operation["requestBody"]["content"]["application/json"]
    body = content["example"] if "example" in content else content["schema"]["examples"][0]
    differs = {"put_plan": {"image": made.get("image")}, "put_anchor": {"x": 4.0}}  # the site has the example by then
    return {"json": body | differs.get(operation["operationId"], {})}


def filled(path: str, operation: dict[str, Any], made: dict[str, Any]) -> str:
    for parameter in operation.get("parameters", []):
        if parameter["in"] == "path":
            example = made.get(parameter["name"], parameter["schema"]["examples"][0])
            path = path.replace(f"{{{parameter['name']}}}", str(example).replace("/", "%2F"))
    return path


def test_every_route_that_writes_leaves_an_entry(audited: Audited) -> None:
    made: dict[str, Any] = {"alarm": audited.ask("GET", "/api/v1/alarms").json()["alarms"][0]["id"]}
    kinds = set()
    for method, path, operation in writing():
        name = operation["operationId"]
        if name in NO_CHANGE:
            continue
        before = audited.entries(limit=1)
        answer = audited.ask(method.upper(), filled(path, operation, made), **example_of(operation, made))
        assert answer.is_success, (name, answer.text)
        if name in ("create_key", "create_share"):
            made[name.removeprefix("create_")] = answer.json()["id"]
        if name == "upload_plan_image":
            made["image"] = answer.json()["image"]
        (entry,) = audited.entries(limit=1)
        assert [entry] != before, f"{name} left no entry"
        assert (entry["by"], entry["confirmed"]) == ({"source": "key", "name": "admin"}, True), name
        assert (entry["after"] is None) == (method == "delete"), name
        kinds.add(entry["kind"])
    omlox = {kind for kind in AuditKind.__args__ if kind.startswith("omlox")}  # type: ignore[attr-defined]
    assert kinds | omlox == set(AuditKind.__args__)  # type: ignore[attr-defined]


def test_each_exception_is_an_operation_that_writes() -> None:
    assert NO_CHANGE.keys() <= {operation["operationId"] for _, _, operation in writing()}


def test_the_omlox_interface_leaves_entries_too(audited: Audited) -> None:
    store = audited.bench.answers.site
    store.set_site(store.site.model_copy(update={"georeference": Georeference(lat=52.5, lon=13.4)}))
    audited.ask("POST", "/omlox/v2/fences", json=FENCE).raise_for_status()
    audited.ask("DELETE", "/omlox/v2/fences").raise_for_status()
    changed = [(one["kind"], one["after"] is None, one["by"]["name"]) for one in audited.entries(limit=4)]
    assert sorted(changed[:2]) == [("omlox-fence", True, "admin"), ("zone", True, "admin")]
    assert sorted(changed[2:]) == [("omlox-fence", False, "admin"), ("zone", False, "admin")]


def test_an_entry_says_who_did_what_and_when_and_what_was_before(audited: Audited) -> None:
    audited.bench.now_ns = T_NS + 5
    audited.put("anchors/17", {"id": "17", "x": 50.0}, by="write")
    audited.put("anchors/17", {"id": "17", "x": 50.0}, by="admin")  # it changes nothing
    assert audited.entries() == [
        {
            "number": 1,
            "t_ns": T_NS + 5,
            "by": {"source": "key", "name": "write"},
            "kind": "anchor",
            "item": "17",
            "before": {"id": "17", "x": 0.0, "y": 0.0, "z": 0.0, "facing_rad": None, "mirrors_behind": True},
            "after": {"id": "17", "x": 50.0, "y": 0.0, "z": 0.0, "facing_rad": None, "mirrors_behind": True},
            "confirmed": True,
        }
    ]


def test_without_access_control_somebody_local_is_named_and_the_first_range_is_of_the_service() -> None:
    bench = make_api_bench()
    app = bench.app()
    ask(app, "DELETE", "/api/v1/anchors/17")
    bench.answers.site.bind_first("9")
    found = ask(app, "GET", "/api/v1/audit").json()["entries"]
    assert [(one["by"]["source"], one["item"], one["after"] is None) for one in found] == [
        ("service", "9", False),
        ("local", "17", True),
    ]


def test_a_refused_change_leaves_no_entry(audited: Audited) -> None:
    refused = [
        ("PUT", "site", {"id": "other"}, "site-id-fixed"),
        ("PUT", "anchors/1", {"id": "2"}, "anchor-id-differs"),
        ("DELETE", "anchors/99", None, "unknown-anchor"),
        ("DELETE", "zones/none", None, "unknown-zone"),
        ("DELETE", "keys/none", None, "unknown-key"),
        ("DELETE", "shares/none", None, "unknown-share"),
    ]
    for method, path, body, kind in refused:
        assert kind_of(audited.ask(method, f"/api/v1/{path}", json=body)) == kind
    stale = audited.ask("PUT", "/api/v1/anchors/17", json={"id": "17", "x": 1}, headers={"if-match": '"stale"'})
    assert kind_of(stale) == "changed-meanwhile"
    assert audited.entries() == []


def test_no_entry_holds_a_secret(audited: Audited) -> None:
    hook = event_examples.WEBHOOK | {"url": "https://mes.example/hidden-path", "secret": f"whsec_{'QUJD' * 10}"}
    audited.put("destinations/mes", hook)
    audited.put("destinations/mes", hook | {"secret": f"whsec_{'REVG' * 10}"})  # a new secret alone is a change
    secrets = [
        audited.ask("POST", "/api/v1/keys", json={"name": "shift", "scope": "read"}).json()["secret"],
        audited.ask("POST", "/api/v1/shares", json={"name": "guests"}).json()["secret"],
    ]
    assert len(audited.entries()) == 4
    for text in (json.dumps(audited.entries()), audited.ask("GET", "/api/v1/audit/file").text):
        assert not any(secret in text for secret in (*secrets, "hidden-path", "QUJD", "REVG", "sha256"))


def test_readers_do_not_see_entries_of_keys_and_links_and_links_read_nothing(audited: Audited) -> None:
    audited.ask("POST", "/api/v1/keys", json={"name": "shift", "scope": "read"}).raise_for_status()
    audited.ask("POST", "/api/v1/shares", json={"name": "guests"}).raise_for_status()
    audited.put("tags/tag-1/settings", {"height_m": 1.5})
    assert [one["kind"] for one in audited.entries()] == ["tag", "share", "key"]
    for by in ("read", "write"):
        assert [one["kind"] for one in audited.entries(by)] == ["tag"]
        assert audited.entries(by, kind="key,share") == []
        assert "guests" not in audited.ask("GET", "/api/v1/audit/file", by).text
    for path in ("audit", "audit/file", "settings"):
        assert kind_of(audited.ask("GET", f"/api/v1/{path}", "link")) == "forbidden"


def test_entries_are_selected_and_read_page_by_page(audited: Audited) -> None:
    for number in range(5):
        audited.bench.now_ns = T_NS + number
        audited.put("anchors/17", {"id": "17", "x": float(number + 1)})
        audited.put("tags/tag-1/settings", {"height_m": float(number + 1)})
    period: dict[str, Any] = {"from": T_NS + 1, "to": T_NS + 2}
    assert [one["after"]["x"] for one in audited.entries(kind="anchor", **period)] == [3, 2]
    assert [one["kind"] for one in audited.entries(item="tag-1", limit=2)] == ["tag", "tag"]
    first = audited.ask("GET", "/api/v1/audit", params={"limit": 7}).json()
    rest = audited.entries(before=first["next"], limit=7)
    assert [one["number"] for one in (*first["entries"], *rest)] == list(range(10, 0, -1))
    assert kind_of(audited.ask("GET", "/api/v1/audit", params={"from": 2, "to": 1})) == "invalid-request"


def test_the_files_have_every_entry(audited: Audited, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dropanchor_service.api.routes.audit.PAGE", 2)
    for number in range(5):
        audited.put("tags/=1+1/settings", {"height_m": float(number + 1)})
    found = audited.entries()
    lines = audited.ask("GET", "/api/v1/audit/file").text.splitlines()
    assert [json.loads(line) for line in lines] == found
    table = list(csv.DictReader(audited.ask("GET", "/api/v1/audit/file?format=csv").text.splitlines()))
    assert [json.loads(row["after"])["height_m"] for row in table] == [5, 4, 3, 2, 1]
    assert {(row["by"], row["item"], row["before"]) for row in table[-1:]} == {("admin", "'=1+1", "null")}


def test_what_was_before_undoes_a_change_through_the_same_route(audited: Audited) -> None:
    site = audited.bench.answers.site
    zone = event_examples.ZONE
    audited.put("zones/dock", zone)
    audited.put("tags/tag-1/settings", {"name": "Cart"})
    before = (site.site, site.tags["tag-1"], audited.ask("GET", "/api/v1/zones").json())
    audited.put("zones/dock", zone | {"name": "Other"})
    audited.put("anchors/17", {"id": "17", "x": 50.0})
    audited.put("site", site.site.model_dump() | {"declination_rad": 0.5})
    audited.put("tags/tag-1/settings", {"name": "Other", "height_m": 3.0})
    audited.ask("DELETE", "/api/v1/tags/tag-1").raise_for_status()
    paths = {"zone": "zones/{}", "anchor": "anchors/{}", "site": "site", "tag": "tags/{}/settings"}
    for entry in audited.entries(limit=5):
        audited.put(paths[entry["kind"]].format(entry["item"]), entry["before"])
    assert (site.site, site.tags["tag-1"], audited.ask("GET", "/api/v1/zones").json()) == before
    assert site.tags["tag-1"] == TagSettings(name="Cart")
