"""A base map lies behind the tags of a turned site, at the right place, and can be hidden."""

import cmath
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, expect
from pmtiles.tile import Compression, TileType

from service.dashboard.basemap_place import ORIGIN, basemap_place, tile_at, tiles_around
from service.dashboard.place import Place
from support.basemap_files import Colour, Tile, basemap_file, image_tile, vector_tile
from support.browser import WatchedPage, watched_page
from support.zenoh_router import wait_until

pytestmark = pytest.mark.browser

COLOURS: tuple[Colour, ...] = ((200, 40, 40), (40, 160, 40), (40, 40, 200), (200, 180, 40), (160, 40, 180))
PLACES = [(x, y) for x in range(-61, 361, 33) for y in range(-61, 261, 33)]
HOLE = tile_at(18, 150, 100)[0]
"""A tile that the map does not have."""
EDGE = 0.02
"""Share of a tile near its edge, where a pixel may belong to its neighbour."""


def colour_of(tile: Tile) -> Colour:
    """Return a colour that differs from those of the neighbours."""
    z, x, y = tile
    return COLOURS[(x + 2 * y + z) % len(COLOURS)]


def faded(colour: Colour) -> Colour:
    """Return how a colour of an image looks on the light page, whose ground is #fbfcfd."""
    red, green, blue = (
        round(0.7 * value + 0.3 * ground) for value, ground in zip(colour, (251, 252, 253), strict=True)
    )
    return red, green, blue


def screen_of(anchors: Sequence[dict[str, Any]], x: float, y: float) -> tuple[float, float]:
    """Return where the map shows a place of the site: two anchors tell."""
    first, other = anchors
    scale = (other["pixel"][0] - first["pixel"][0]) / (other["x"] - first["x"])
    return first["pixel"][0] + scale * (x - first["x"]), first["pixel"][1] - scale * (y - first["y"])


def errors_of(page: WatchedPage) -> list[str]:
    """Return what the page logged, without the browser's remark that a test reads many pixels."""
    return [error for error in page.errors if "getImageData" not in error]


def wait_for_basemap(page: WatchedPage) -> int:
    """Wait until the base map is complete. Return its zoom level."""
    page.wait_for("dropanchor.anchors().length === 2 && dropanchor.drawing().still && dropanchor.basemap().tiles > 0")
    page.page.wait_for_timeout(300)
    page.wait_for("dropanchor.drawing().still && dropanchor.basemap().still")
    zoom: int = page.page.evaluate("dropanchor.basemap().zoom")
    return zoom


def seen_and_expected(page: WatchedPage, z: int) -> list[tuple[tuple[int, ...], Colour]]:
    """Return what the map shows at places, and the colour of the tile there, away from edges and other symbols."""
    box = page.page.locator("#map").bounding_box()
    assert box is not None
    anchors = page.page.evaluate("dropanchor.anchors()")
    found = []
    for x, y in PLACES:
        tile, inside = tile_at(z, x, y)
        px, py = screen_of(anchors, x, y)
        is_free = 30 < px < box["width"] - 80 and 30 < py < box["height"] - 60
        if is_free and min(*inside, *(1 - value for value in inside)) > EDGE:
            shown = (z - 1, tile[1] // 2, tile[2] // 2) if tile == HOLE else tile  # the coarser one stands in
            found.append(((px, py), faded(colour_of(shown))))
    seen = page.pixels([place for place, _ in found])
    return [(colour[:3], wanted) for colour, (_, wanted) in zip(seen, found, strict=True)]


def shares(page: WatchedPage, z: int) -> tuple[int, int]:
    """Return how many places have the right colour, and how many there are."""
    pairs = seen_and_expected(page, z)
    return sum(max(abs(a - b) for a, b in zip(seen, wanted, strict=True)) < 12 for seen, wanted in pairs), len(pairs)


def test_images_lie_right_behind_a_turned_site_at_every_zoom_and_can_be_hidden(
    chromium: Browser, tmp_path: Path
) -> None:
    images = {colour: image_tile(colour) for colour in COLOURS}
    tiles = {tile: images[colour_of(tile)] for z in (16, 17, 18) for tile in tiles_around(z, 900)}
    del tiles[HOLE]
    with (
        basemap_place(basemap_file(tmp_path / "map.pmtiles", tiles)) as place,
        watched_page(chromium, place.url) as page,
    ):
        _check_every_zoom(page)
        _check_the_switch(page, place, chromium)
        assert page.origins == {place.url.rstrip("/")}
        assert errors_of(page) == []


def _check_every_zoom(page: WatchedPage) -> None:
    zooms = set()
    for press in (None, "+", "-", "-", "-"):
        if press:
            page.page.locator("#zoom-in" if press == "+" else "#zoom-out").click()
        zoom = wait_for_basemap(page)
        zooms.add(zoom)
        right, of_all = shares(page, zoom)
        assert of_all > 10
        assert right > 0.9 * of_all, (zoom, right, of_all)  # rings and texts lie above the others
    assert zooms == {16, 17, 18}


def _check_the_switch(page: WatchedPage, place: Place, chromium: Browser) -> None:
    credit = page.page.locator("#attribution")
    expect(credit).to_have_text("© OpenStreetMap")
    expect(credit.locator("a")).to_have_attribute("href", "https://www.openstreetmap.org/copyright")
    page.page.locator("#options").click()
    tick = page.page.get_by_label("Base map")
    tick.uncheck()
    expect(credit).to_be_hidden()
    wait_until(lambda: shares(page, 16)[0] == 0)
    page.wait_for("location.hash.includes('basemap=off')")
    with watched_page(
        chromium,
        page.page.url,
        prepare=lambda old: old.add_init_script("delete globalThis.OffscreenCanvas"),  # it paints in the page then
    ) as copied:
        copied.wait_for("dropanchor.anchors().length === 2 && dropanchor.drawing().still")
        copied.page.locator("#options").click()
        copied.page.get_by_label("Base map").check()
        zoom = wait_for_basemap(copied)
        right, of_all = shares(copied, zoom)
        assert right > 0.9 * of_all
        assert "basemap" not in copied.page.url
    place.bench.answers.site.set_site(place.bench.answers.site.site.model_copy(update={"georeference": None}))
    expect(tick).to_be_hidden()


def test_a_road_of_a_vector_tile_lies_right_in_light_and_dark(chromium: Browser, tmp_path: Path) -> None:
    tile, (u, v) = tile_at(15, 150, 100)
    there = (round(4096 * u), round(4096 * v))
    road = [(there[0] - 4000, there[1]), (there[0] + 4000, there[1])]
    lake = [(there[0] - 900, there[1] + 100), (there[0] - 900, there[1] + 500), (there[0] + 900, there[1] + 500)]
    lake = [*lake, (there[0] + 900, there[1] + 100), lake[0]]
    content = vector_tile({"water": [("lake", lake)], "roads": [("highway", road)]})
    path = basemap_file(tmp_path / "map.pmtiles", {tile: content}, TileType.MVT, Compression.GZIP)
    with (
        basemap_place(path, "Yard plan <b>2026</b>") as place,
        watched_page(chromium, place.url) as page,
    ):
        assert wait_for_basemap(page) == 15
        expect(page.page.locator("#attribution")).to_have_text("Yard plan 2026")
        light = _colours_across(page)
        page.page.locator("#theme").click()
        assert light == [(255, 255, 255), (241, 243, 245), (207, 225, 240)]
        wait_until(lambda: _colours_across(page) == [(44, 55, 67), (21, 27, 34), (20, 40, 58)])
        assert errors_of(page) == []


def _colours_across(page: WatchedPage) -> list[tuple[int, ...]]:
    """Return the colours on the road, 12 m north of it, and 40 m south of it, in the lake."""
    anchors = page.page.evaluate("dropanchor.anchors()")
    places = [complex(150, 100) + 1j * north_m * cmath.exp(-1j * ORIGIN.rotation_rad) for north_m in (2, 12, -40)]
    return [colour[:3] for colour in page.pixels([screen_of(anchors, place.real, place.imag) for place in places])]
