"""The accessibility checker axe-core finds no violation on a page with a base map."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect
from pmtiles.tile import TileType

from service.dashboard.basemap_place import basemap_place, tile_at
from support.axe import violations
from support.basemap_files import basemap_file, vector_tile
from support.browser import watched_page

pytestmark = pytest.mark.browser


def test_no_violation_while_a_base_map_is_shown_and_hidden(chromium: Browser, axe: str, tmp_path: Path) -> None:
    tile, _ = tile_at(15, 0, 0)
    roads = [("major_road", [(0, 0), (4096, 4096)]), ("minor_road", [(0, 4096), (4096, 0)])]
    path = basemap_file(tmp_path / "map.pmtiles", {tile: vector_tile({"roads": roads})}, TileType.MVT)
    with (
        basemap_place(path) as place,
        watched_page(chromium, f"{place.url}?lang=de") as page,
    ):
        place.move("cart", x=20.0, y=10.0)
        page.wait_for("dropanchor.basemap().tiles > 0 && dropanchor.tags().length === 1")
        assert violations(page.page, axe) == []
        page.page.locator("#options").click()
        page.page.locator("#basemap").focus()
        page.page.keyboard.press("Space")
        expect(page.page.get_by_label("Hintergrundkarte")).not_to_be_checked()
        assert violations(page.page, axe) == []
        assert page.errors == []
