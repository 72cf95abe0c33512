"""OGC API – Features: tags, zones and tracks, as GDAL reads them."""

import shutil
import subprocess
from pathlib import Path

import pytest
from fastapi import FastAPI

from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_schemas.zones import Circle, Zone
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.estimation.columns import State
from dropanchor_service.history.storage import Retention
from support.api import T_NS, ApiBench, ask, kind_of, make_api_bench
from support.http_server import running_server

OGC = "/api/v1/ogc"
PLACE = Georeference(lat=52.5, lon=13.4)


def bench_in(folder: Path, georeference: Georeference | None = PLACE) -> tuple[ApiBench, FastAPI]:
    """Return a site with a zone, and with three tags, of which `c` is 1 km in the east and `b` has gone 10 m north."""
    site = Site(id="ogc", anchors=[Anchor(id="17")], georeference=georeference)
    bench = make_api_bench(site, folder, Retention(1, 0.0, 0, 10**18, 2**40))
    bench.move("a", "c", "b", x=[0.0, 1000.0, 0.0])
    for second in range(1, 11):
        bench.now_ns = T_NS + second * 10**9
        bench.move("b", y=float(second), state=State.TRACKING if second != 5 else State.AMBIGUOUS)
    bench.write_history()
    parts = EventParts.in_memory("yard")
    parts.items.zones.put("dock", Zone(id="dock", name="Dock", shape=Circle(type="circle", x=0, y=0, radius_m=5)))
    return bench, bench.app(events=parts)


def ids(app: FastAPI, query: str) -> list[str]:
    answer = ask(app, "GET", f"{OGC}/collections/{query}")
    assert answer.headers["content-type"] == "application/geo+json", answer.text
    return [feature["id"] for feature in answer.json()["features"]]


@pytest.mark.parametrize("root", [OGC, "/api/v1/sites/ogc/ogc"])
def test_every_link_leads_to_what_it_says(root: str, tmp_path: Path) -> None:
    _, app = bench_in(tmp_path)
    seen, waiting = set[str](), ["http://test" + root]
    while waiting:
        url = waiting.pop()
        answer = ask(app, "GET", url.removeprefix("http://test"))
        assert answer.status_code == 200, url
        seen.add(url)
        if "json" in answer.headers["content-type"] and not url.endswith("openapi.json"):
            described = [answer.json(), *answer.json().get("collections", [])]
            found = {link["href"] for one in described for link in one.get("links", [])}
            waiting += found - seen - {*waiting}
    assert {f"http://test{root}/collections/{name}/items" for name in ("tags", "zones", "tracks")} <= seen
    assert ask(app, "GET", f"{OGC}/conformance").json()["conformsTo"][0].endswith("/core")


def test_a_box_and_a_time_select_and_pages_follow_each_other(tmp_path: Path) -> None:
    _, app = bench_in(tmp_path)
    assert ids(app, "tags/items") == ["a", "b", "c"]
    assert ids(app, "tags/items?bbox=13.399,52.4,13.401,52.6") == ["a", "b"]
    assert ids(app, "tags/items?bbox=13.401,52.4,0,-180,52.6,9") == ["c"]  # across the antimeridian
    assert ids(app, "zones/items?bbox=13.40005,52.4,13.5,52.6") == ["dock"]
    assert ids(app, "zones/items?bbox=13.401,52.4,13.5,52.6") == []
    assert ids(app, "tags/items?datetime=2027-01-15T08:00:05Z/..") == ["b"]
    assert ids(app, "tags/items?datetime=2027-01-15T08:00:00Z") == ["a", "c"]
    first = ask(app, "GET", f"{OGC}/collections/tags/items?limit=2&bbox=13,52,14,53").json()
    assert (first["numberMatched"], first["numberReturned"]) == (3, 2)
    (following,) = (link["href"] for link in first["links"] if link["rel"] == "next")
    last = ask(app, "GET", following.removeprefix("http://test")).json()
    assert [feature["id"] for feature in last["features"]] == ["c"]
    assert [link["rel"] for link in last["links"]] == ["self"]


def test_a_track_is_a_line_through_the_tracked_poses_of_a_period(tmp_path: Path) -> None:
    _, app = bench_in(tmp_path)
    track = ask(app, "GET", f"{OGC}/collections/tracks/items/b").json()
    assert track["geometry"]["type"] == "LineString"
    norths = [round((lat - PLACE.lat) * 111_270, 1) for _, lat in track["geometry"]["coordinates"]]
    assert norths == sorted(norths)
    assert 5.0 not in norths
    assert (track["properties"]["poses"], norths[-1]) == (11, 10.0)
    part = ask(app, "GET", f"{OGC}/collections/tracks/items?datetime=2027-01-15T08:00:08Z/..").json()["features"]
    assert [(one["id"], len(one["geometry"]["coordinates"])) for one in part] == [("b", 3)]


@pytest.mark.parametrize("root", [OGC, "/api/v1/sites/ogc/ogc"])
def test_what_is_not_there_or_wrong_has_the_status_of_the_standard(root: str, tmp_path: Path) -> None:
    _, app = bench_in(tmp_path)
    wanted = {
        "/collections/tags/items?limit=20000": 200,  # as many as there may be
        "/collections/tags/items/nobody": 404,
        "/collections/tags/items/%00": 404,
        "/collections/cats": 404,
        "/collections/cats/items": 404,
        "?f=json": 400,
        "/conformance?f=json": 400,
        "/collections/tags?f=json": 400,
        "/collections/tags/items/a?f=json": 400,
        "/collections/tags/items?box=1,2,3,4": 400,
        "/collections/tags/items?bbox=1,2,3": 400,
        "/collections/tags/items?limit=0": 400,
        "/collections/tags/items?limit=unlimited": 400,
        "/collections/tags/items?datetime=yesterday": 400,
        "/collections/tags/items?datetime=2027-01-15T09:00:00Z/2027-01-15T08:00:00Z": 400,
        "/collections/tracks/items?datetime=2026-01-01T00:00:00Z/..": 400,
    }
    answers = {path: ask(app, "GET", root + path) for path in wanted}
    assert {path: answer.status_code for path, answer in answers.items()} == wanted
    kinds = {answer.status_code: kind_of(answer) for answer in answers.values() if answer.status_code != 200}
    assert kinds == {400: "invalid-request", 404: "not-found"}
    assert ask(app, "GET", "/api/v1/poses?f=json").status_code == 422  # as everywhere else


def test_a_site_without_a_georeference_says_what_it_lacks(tmp_path: Path) -> None:
    _, app = bench_in(tmp_path, None)
    assert kind_of(ask(app, "GET", f"{OGC}/collections/tags/items")) == "not-georeferenced"


@pytest.mark.skipif(shutil.which("ogrinfo") is None, reason="GDAL is not installed: apt-get install gdal-bin")
def test_gdal_reads_the_collections_and_the_geojson_of_poses(tmp_path: Path) -> None:
    def ogrinfo(*words: str) -> str:
        done = subprocess.run(["ogrinfo", "-ro", *words], check=False, capture_output=True, text=True, timeout=120)
        assert (done.returncode, done.stderr) == (0, ""), done.stderr + done.stdout
        return done.stdout

    bench, app = bench_in(tmp_path)
    with running_server(app, bench.stopping) as port:
        url = f"http://127.0.0.1:{port}"
        layers = ogrinfo(f"OAPIF:{url}{OGC}")
        assert all(f": {name}" in layers for name in ("tags", "zones", "tracks")), layers
        tags = ogrinfo("-al", "-so", f"OAPIF:{url}{OGC}", "tags")
        assert "Feature Count: 3" in tags
        assert "state: String" in tags
        near = ogrinfo("-spat", "13.399", "52.4", "13.401", "52.6", "-so", f"OAPIF:{url}{OGC}", "tags")
        assert "Feature Count: 2" in near
        assert "POLYGON" in ogrinfo(f"OAPIF:{url}{OGC}", "zones")
        assert "LINESTRING" in ogrinfo(f"OAPIF:{url}{OGC}", "tracks")
        assert "Feature Count: 3" in ogrinfo("-al", "-so", f"{url}/api/v1/poses?format=geojson")
