"""The base map over REST."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi import FastAPI
from pmtiles.tile import Compression, TileType

from dropanchor_service.api.http.permissions import Need, need_of
from dropanchor_service.basemap.basemap import ServedBasemap
from dropanchor_service.basemap.errors import UnreadableTileError
from support.api import ask, kind_of, make_api_bench
from support.basemap_files import basemap_file, image_tile, vector_tile

RED = image_tile((255, 0, 0))
ROAD = vector_tile({"roads": [("major_road", [(0, 0), (4096, 4096)])]})


@pytest.fixture
def basemap(tmp_path: Path) -> Iterator[ServedBasemap]:
    served = ServedBasemap(basemap_file(tmp_path / "map.pmtiles", {(3, 4, 2): RED}, bounds=(0, 40, 45.5, 67)), None)
    yield served
    served.file.close()


@pytest.fixture
def app(basemap: ServedBasemap) -> FastAPI:
    return make_api_bench().app(basemap=basemap)


def test_the_description_names_the_zooms_and_who_made_the_map(app: FastAPI, basemap: ServedBasemap) -> None:
    assert ask(app, "GET", "/api/v1/basemap").json()["tiles"] == {
        "version": basemap.file.version,
        "media_type": "image/png",
        "min_zoom": 3,
        "max_zoom": 3,
        "west": 0.0,
        "south": 40.0,
        "east": 45.5,
        "north": 67.0,
        "attribution": [{"text": "© OpenStreetMap", "link": "https://www.openstreetmap.org/copyright"}],
    }


def test_a_tile_is_served_once_and_then_confirmed(app: FastAPI) -> None:
    served = ask(app, "GET", "/api/v1/basemap/3/4/2")
    assert (served.content, served.headers["content-type"]) == (RED, "image/png")
    assert served.headers["cache-control"] == "private, no-cache"
    again = ask(app, "GET", "/api/v1/basemap/3/4/2", headers={"if-none-match": f'"other", {served.headers["etag"]}'})
    assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", served.headers["etag"])
    other = ask(app, "GET", "/api/v1/basemap/3/4/2", headers={"if-none-match": '"other"'})
    assert other.status_code == 200


@pytest.mark.parametrize("compression", [Compression.NONE, Compression.GZIP])
def test_a_vector_tile_is_served_as_it_is_without_compression(tmp_path: Path, compression: Compression) -> None:
    path = basemap_file(tmp_path / "map.pmtiles", {(3, 4, 2): ROAD}, TileType.MVT, compression)
    basemap = ServedBasemap(path, None)
    served = ask(make_api_bench().app(basemap=basemap), "GET", "/api/v1/basemap/3/4/2")
    assert (served.content, served.headers["content-type"]) == (ROAD, "application/vnd.mapbox-vector-tile")
    assert "content-encoding" not in served.headers
    basemap.file.close()


def test_a_tile_that_is_not_there_has_no_content_and_one_that_cannot_be_is_refused(app: FastAPI) -> None:
    for path in ("3/4/3", "0/0/0", "2/2/1", "31/5/5"):
        missing = ask(app, "GET", f"/api/v1/basemap/{path}")
        assert (missing.status_code, missing.content) == (204, b"")
    for path in (
        "3/8/2",
        "3/4/8",
        "0/0/1",
        "32/0/0",
        "-1/0/0",
        "3/4/-2",
        "3/a/2",
        "3/4.5/2",
        f"31/{2**31}/0",
        "3/4/2?a=1",
    ):
        assert kind_of(ask(app, "GET", f"/api/v1/basemap/{path}")) == "invalid-request"
    assert ask(app, "GET", "/api/v1/basemap/3/8/2").json()["detail"] == "path: at zoom 3, x and y are below 8"


def test_without_a_base_map_the_description_says_so() -> None:
    app = make_api_bench().app()
    assert ask(app, "GET", "/api/v1/basemap").json() == {"tiles": None}
    assert kind_of(ask(app, "GET", "/api/v1/basemap/0/0/0")) == "no-basemap"


def test_a_damaged_tile_is_a_problem_with_a_sentence(tmp_path: Path) -> None:
    path = basemap_file(tmp_path / "map.pmtiles", {(3, 4, 2): RED})
    basemap = ServedBasemap(path, None)
    path.write_bytes(path.read_bytes()[:-1])
    refused = ask(make_api_bench().app(basemap=basemap), "GET", "/api/v1/basemap/3/4/2")
    assert kind_of(refused) == "basemap-unreadable"
    assert refused.json()["detail"] == "The file of the base map is not complete: it ends too early."
    basemap.file.close()


def test_tiles_are_not_read_in_the_thread_of_the_event_loop(
    app: FastAPI, basemap: ServedBasemap, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads = []

    def tile(*_: int) -> None:
        threads.append(threading.current_thread())
        raise UnreadableTileError("is damaged")

    monkeypatch.setattr(basemap.file, "tile", tile)
    ask(app, "GET", "/api/v1/basemap/3/4/2")
    assert threads
    assert threading.main_thread() not in threads


@pytest.mark.parametrize(
    ("written", "setting", "texts"),
    [
        ({"attribution": "A"}, None, ["A"]),
        ({"attribution": "A"}, "B <a href='https://b.example'>C</a>", ["B ", "C"]),
        ({"attribution": 5}, None, []),
        ({"attribution": "A"}, "", []),
        ({}, None, []),
    ],
)
def test_the_setting_takes_the_place_of_the_attribution_in_the_file(
    tmp_path: Path, written: dict[str, object], setting: str | None, texts: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    basemap = ServedBasemap(basemap_file(tmp_path / "map.pmtiles", {(0, 0, 0): RED}, metadata=written), setting)
    basemap.file.close()
    assert basemap.description.tiles is not None
    assert [part.text for part in basemap.description.tiles.attribution] == texts
    assert ("does not say who made the map" in caplog.text) == (setting is None and not texts)


def test_visitors_see_the_base_map() -> None:
    assert need_of("GET", "/api/v1/basemap") is Need.LINK
    assert need_of("GET", "/api/v1/basemap/0/0/0") is Need.LINK
