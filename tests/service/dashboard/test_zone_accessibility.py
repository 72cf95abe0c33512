"""The accessibility checker axe-core finds no violation in the views of zones and events."""

from contextlib import ExitStack

import pytest
from playwright.sync_api import Browser

from service.dashboard.zone_place import ZonePlace, disc, served, square, zone_place
from support.axe import violations
from support.browser import WatchedPage, watched_page

pytestmark = pytest.mark.browser


def busy_yard() -> ZonePlace:
    """Return a place with an occupied and an empty zone, and some events."""
    place = zone_place()
    place.put(
        square("yard", 1.0, 1.0, name="Yard 10", colour="#b3261e"),
        disc("dock", -3.0, 0.0, 1.5, name="Loading dock"),
        square("gate", -4.0, 4.0, side=2.0, name="Gate with a rather long name", colour="#1b7f3b"),
    )
    for tag, x, y in (("cart-3", 3.0, 3.0), ("cart-4", -3.0, 0.0), ("forklift-north-hall-17", 9.0, 0.0)):
        place.go(tag, -10.0, -10.0)
        place.go(tag, x, y)
    return place


def draw_a_crossing(page: WatchedPage) -> None:
    """Draw a polygon that the service refuses."""
    size = page.page.locator("#map").bounding_box()
    assert size is not None
    page.page.locator("#new-polygon").click()
    for across, down in ((0.3, 0.3), (0.6, 0.6), (0.6, 0.3), (0.3, 0.6)):
        page.page.locator("#map").click(position={"x": across * size["width"], "y": down * size["height"]})
    page.page.get_by_role("button", name="Save zone").click()
    page.page.get_by_role("form", name="Zone", exact=True).get_by_role("alert").wait_for()


def test_no_violation_in_the_lists_the_editor_and_without_a_connection(chromium: Browser, axe: str) -> None:
    place = busy_yard()
    with ExitStack() as pages:
        with served(place):
            page = pages.enter_context(watched_page(chromium, place.url))

            def check(view: str, within: str = "html") -> None:
                assert violations(page.page, axe, within) == [], view

            page.wait_for("dropanchor.events() && dropanchor.zones().yard === 1")
            page.page.locator("#events summary").click()
            check("events")
            page.page.get_by_role("button", name="cart-3 entered Yard 10").click()
            check("selected", "#detail")
            page.page.locator("#zone-list summary").click()
            check("zones", "#zones")
            page.page.get_by_role("button", name="Who is where").click()
            page.page.locator("#headcount li").first.wait_for()
            check("headcount", "#headcount")
            page.page.locator("#headcount").get_by_role("button", name="Close").click()
            page.page.get_by_role("button", name="Edit Yard 10").click()
            page.page.get_by_role("button", name="Corner 1 of 4").wait_for()
            page.page.get_by_role("button", name="Delete…").click()
            check("editing")  # also on the map
            page.page.get_by_role("button", name="Cancel").last.click()
            draw_a_crossing(page)
            check("refused", "#zones")
            page.page.locator("#events summary").click()
        page.page.locator("#lost").wait_for(state="visible")
        check("lost")
