"""Fences are the zones of the service."""

import math
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest

from dropanchor_schemas.zones import Polygon, Zone
from dropanchor_service.store.omlox_models import Fence
from support.api import ask
from support.events import circle
from support.omlox import BARE, OmloxBench

SQUARE = Zone(id="hall", name="Hall", shape=Polygon(type="polygon", points=[[0, 0], [20, 0], [20, 10], [0, 10]]))


def test_zones_appear_as_fences_in_metres_and_degrees() -> None:
    bench = OmloxBench()
    bench.zones.put(SQUARE, circle("dock", 5.0, 6.0, 2.0))
    hall, dock = bench.get("fences/summary", crs="local")
    assert bench.get("fences") == [hall["id"], dock["id"]]
    assert hall["name"] == "Hall"
    assert hall["region"]["coordinates"] == [[[0, 0], [20, 0], [20, 10], [0, 10], [0, 0]]]
    assert (dock["region"], dock["radius"]) == ({"type": "Point", "coordinates": [5.0, 6.0]}, 2.0)
    assert hall["zone_id"] in bench.get("zones")
    on_earth = bench.get(f"fences/{hall['id']}")
    Fence.model_validate(on_earth)
    corner = on_earth["region"]["coordinates"][0][1]
    bench.poses.move("tag-1", x=20.0, y=0.0)
    assert corner == pytest.approx(bench.get("providers/tag-1/location")["position"]["coordinates"], abs=1e-9)
    feature = bench.get(f"fences/{dock['id']}", geojson="true")
    assert (feature["geometry"]["type"], feature["properties"]["radius"]) == ("Point", 2.0)
    assert len(bench.get("fences/summary", geojson="true")["features"]) == 2


@pytest.mark.parametrize("crs", ["local", "EPSG:4326", None])
def test_a_fence_becomes_a_zone_of_the_service_with_the_same_place(crs: str | None, tmp_path: Path) -> None:
    bench = OmloxBench(folder=tmp_path)
    bench.zones.put(SQUARE)
    (shown,) = bench.get("fences/summary", crs=crs or "EPSG:4326")
    body = {"name": "Copy", "region": shown["region"], "properties": {"a": 1}, "timeout": 500, "foreign_id": "f"}
    where = {} if crs is None else {"crs": crs, "zone_id": bench.get("zones")[0]}
    made = bench.ask("POST", "fences", json=body | where)
    assert made.status_code == 201, made.text
    identifier = made.json()["id"]
    zone = ask(bench.app, "GET", f"/api/v1/zones/{identifier}").json()
    assert zone["name"] == "Copy"
    expected = [list(point) for point in SQUARE.shape.points]  # type: ignore[union-attr]
    for point, wanted in zip(zone["shape"]["points"], expected, strict=True):
        assert math.dist(point, wanted) < 1e-3
    bench.start()
    again = bench.get(f"fences/{identifier}")
    assert (again["timeout"], again["foreign_id"], again["properties"]["a"]) == (500, "f", 1)


def test_a_change_of_a_fence_keeps_what_only_the_zone_has() -> None:
    bench = OmloxBench()
    bench.zones.put(SQUARE.model_copy(update={"tags": ["tag-1"], "delay_s": 3.0, "colour": "#112233"}))
    (identifier,) = bench.get("fences")
    body = {"region": {"type": "Point", "coordinates": [1, 2]}, "radius": 4, "crs": "local", "zone_id": "17"}
    assert bench.ask("PUT", f"fences/{identifier}", json=body | {"name": "Gate"}).status_code == 204
    zone = bench.zones.items.zones.all["hall"]
    assert (zone.name, zone.tags, zone.delay_s, zone.colour) == ("Gate", ["tag-1"], 3.0, "#112233")
    assert zone.shape == circle("x", 1.0, 2.0, 4.0).shape
    assert bench.ask("DELETE", f"fences/{identifier}").status_code == 204
    assert not bench.zones.items.zones.all
    assert bench.refusal("GET", f"fences/{identifier}")[0] == "unknown-fence"


BOW = [[13.4, 52.5], [13.401, 52.501], [13.401, 52.5], [13.4, 52.501], [13.4, 52.5]]
HOLE = [[13.4001, 52.5001], [13.4002, 52.5001], [13.4002, 52.5002], [13.4001, 52.5001]]
RING = [[13.4, 52.5], [13.401, 52.5], [13.401, 52.501], [13.4, 52.5]]


@pytest.mark.parametrize(
    ("body", "kind", "words"),
    [
        ({"region": {"type": "Point", "coordinates": [13.4, 52.5]}}, "shape-refused", "radius"),
        ({"region": {"type": "Polygon", "coordinates": [BOW]}}, "shape-refused", "cross"),
        ({"region": {"type": "Polygon", "coordinates": [RING, HOLE]}}, "shape-refused", "holes"),
        ({"region": {"type": "Point", "coordinates": [500, 800]}, "radius": 5}, "shape-refused", "degrees"),
        ({"region": {"type": "Point", "coordinates": [2.3, 48.8]}, "radius": 5}, "invalid-request", "100000"),
        ({"region": {"type": "Point", "coordinates": [13.4, 52.5]}, "radius": 1e6}, "invalid-request", "10000"),
        (
            {"region": {"type": "Point", "coordinates": [1, 2]}, "radius": 5, "crs": "local"},
            "invalid-request",
            "zone_id",
        ),
        ({"region": {"type": "Line", "coordinates": []}}, "invalid-request", "Point"),
        (
            {"region": {"type": "Point", "coordinates": [1, 2]}, "radius": 5, "crs": "EPSG:3857"},
            "invalid-request",
            "crs",
        ),
    ],
)
def test_a_fence_that_cannot_be_a_zone_is_refused_with_a_reason(body: dict[str, Any], kind: str, words: str) -> None:
    bench = OmloxBench()
    found, code, message = bench.refusal("POST", "fences", json=body)
    assert (found, code) == (kind, 400)
    assert words in message
    assert not bench.zones.items.zones.all


def test_without_a_georeference_a_fence_in_degrees_is_refused() -> None:
    bench = OmloxBench(BARE)
    body = {"region": {"type": "Point", "coordinates": [13.4, 52.5]}, "radius": 5}
    assert bench.refusal("POST", "fences", json=body)[0] == "not-georeferenced"
    local = body | {"crs": "local", "zone_id": bench.get("zones")[0]}
    assert bench.ask("POST", "fences", json=local).json()["crs"] == "local"


def test_a_fence_keeps_the_id_that_its_client_gives() -> None:
    bench, identifier = OmloxBench(), str(uuid4())
    body = {"id": identifier, "region": {"type": "Point", "coordinates": [13.4, 52.5]}, "radius": 5}
    assert bench.ask("POST", "fences", json=body).json()["id"] == identifier
    assert bench.refusal("POST", "fences", json=body)[0] == "exists-already"
    assert bench.ask("PUT", f"fences/{identifier}", json=body | {"id": str(uuid4())}).status_code == 409


def test_who_is_inside_goes_by_entries_or_by_the_place_alone() -> None:
    bench = OmloxBench()
    bench.zones.put(circle("dock", radius_m=5.0))
    (fence,) = bench.get("fences")
    bench.zones.stay(2.0, "tag-1", x=0.0, y=0.0)
    bench.zones.stay(0.4, "tag-2", x=1.0, y=0.0)  # not long enough for an entry

    def inside(**query: str) -> list[list[str]]:
        providers = [one["id"] for one in bench.get(f"fences/{fence}/providers", **query)]
        trackables = [one["name"] for one in bench.get(f"fences/{fence}/trackables", **query)]
        locations = [one["provider_id"] for one in bench.get(f"fences/{fence}/locations", **query)]
        motions = [one["location"]["provider_id"] for one in bench.get(f"fences/{fence}/motions", **query)]
        return [providers, trackables, locations, motions]

    assert inside() == [["tag-1"]] * 4
    assert inside(spatial_query="true") == [["tag-1", "tag-2"]] * 4
    for path in (f"trackables/{bench.id_of('tag-2')}", "providers/tag-2"):
        assert bench.get(f"{path}/fences") == []
        assert [one["id"] for one in bench.get(f"{path}/fences", spatial_query="true")] == [fence]
    assert [one["id"] for one in bench.get("providers/tag-1/fences")] == [fence]
