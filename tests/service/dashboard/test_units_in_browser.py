"""A person chooses the units of lengths and speeds; what is stored and sent stays SI."""

import re

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.zones import Circle
from service.dashboard.zone_place import ZonePlace, disc, served, zone_place
from support.browser import WatchedPage, watched_page
from support.zenoh_router import wait_until

pytestmark = pytest.mark.browser


def radius_of(place: ZonePlace) -> float:
    """Return the radius of the dock in m."""
    shape = place.zones["dock"].shape
    assert isinstance(shape, Circle)
    return shape.radius_m


def test_units_are_chosen_remembered_and_used_everywhere_while_settings_stay_si(chromium: Browser) -> None:
    place = zone_place()
    place.put(disc("dock", 0.0, 0.0, 3.048, name="Dock", speed_mps=2.5))
    place.go("cart", 3.048, -6.096)
    place.move("cart", x=3.048, y=-6.096, speed=2.0, cov=np.diag([0.25, 0.25, 0.001]))
    with served(place), watched_page(chromium, place.url) as watched:
        page = watched.page
        page.get_by_role("button", name="Display").click()
        page.get_by_label("Lengths").select_option("ft")
        page.get_by_role("button", name="Display").click()
        page.get_by_label("Speeds").select_option("mph")
        row = page.locator("tr[data-tag='cart']")
        expect(row.locator(".c-x")).to_have_text("10.00")
        expect(row.locator(".c-y")).to_have_text("−20.00")
        expect(row.locator(".c-accuracy")).to_have_text("4.02")
        expect(row.locator(".c-speed")).to_have_text("4.47")
        expect(page.locator("th.c-x")).to_have_text("x ft")
        row.click()
        expect(page.locator("[data-part='v-x']")).to_have_text("10.00 ft")
        expect(page.locator("[data-part='v-speed']")).to_have_text("4.47 mph")
        assert "length=ft" in page.url
        page.goto(place.url)
        expect(row.locator(".c-x")).to_have_text("10.00")
        page.locator("#zone-list summary").click()
        page.get_by_role("button", name="Edit Dock").click()
        radius, fast = page.locator("[name='radius_m']"), page.get_by_label("Too fast above")
        expect(radius).to_have_value("10")
        expect(fast).to_have_value("5.592")
        page.locator("#zone-form").get_by_label("Name").fill("Pier")
        page.get_by_role("button", name="Save zone").click()
        expect(page.locator("#zone-form")).to_be_hidden()
        assert place.zones["dock"].name == "Pier"
        assert (radius_of(place), place.zones["dock"].speed_mps) == (3.048, 2.5)
        page.get_by_role("button", name="Edit Pier").click()
        radius.fill("20")
        page.get_by_role("button", name="Save zone").click()
        wait_until(lambda: radius_of(place) == pytest.approx(6.096))
        page.locator("#edit").click()
        assert not re.search(r"\d m\b", page.locator("#setup").inner_text())
        page.locator("#setup [data-part='new']").click()
        page.locator("#setup [name='id']").fill("north")
        page.locator("#setup [name='y']").fill("100")
        page.locator("#setup [name='x']").fill("0")
        page.locator("#setup [data-part='save']").click()
        wait_until(lambda: any(a.id == "north" for a in place.bench.answers.site.site.anchors))
        north = next(a for a in place.bench.answers.site.site.anchors if a.id == "north")
        assert [north.x, north.y] == pytest.approx([0.0, 30.48])
        watched.wait_for("dropanchor.drawing().still")
        assert watched.errors == []
        check_layers(watched)


def check_layers(watched: WatchedPage) -> None:
    """Hide zones, rings and names. The selected tag keeps its name, and the browser remembers the choice."""
    page = watched.page
    page.locator("#fit").click()
    watched.wait_for("dropanchor.drawing().still && dropanchor.drawing().labels.length === 1")
    shown = watched.pixel(*page.evaluate("dropanchor.screen(4.1, 1.3)"))  # in the zone
    page.locator("#options").click()
    for layer in ("Zones", "Rings of distance", "Names"):
        page.get_by_role("group", name="Layers of the map").get_by_label(layer).uncheck()
    watched.wait_for("dropanchor.drawing().still && dropanchor.drawing().labels.length === 0")
    hidden = watched.pixel(*page.evaluate("dropanchor.screen(4.1, 1.3)"))
    assert hidden != shown
    page.reload()
    watched.wait_for("dropanchor.drawing().still && dropanchor.tags().length === 1")
    assert watched.pixel(*page.evaluate("dropanchor.screen(4.1, 1.3)")) == hidden
    page.locator("tr[data-tag='cart']").click()
    watched.wait_for("dropanchor.drawing().labels.length === 1")
