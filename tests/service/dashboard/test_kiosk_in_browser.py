"""The page on a wall: large type, no controls, a screen that stays on, and one tag after another when asked."""

import re

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from service.dashboard.place import Place
from support.browser import watched_page

pytestmark = pytest.mark.browser

WAKE = """
    window.wakes = 0;
    Object.defineProperty(navigator, "wakeLock", { value: { request: async () => { window.wakes++; return {}; } } });
"""
CONTROLS = """() => [...document.querySelectorAll("header button, .tools button, input, select, .zones, .text, .json")]
    .filter((one) => one.checkVisibility()).map((one) => one.id || one.className)"""
SMALLEST = """() => Math.min(...[...document.querySelectorAll("header *, aside *")]
    .filter((one) => one.checkVisibility() && [...one.childNodes].some(({ data }) => data?.trim()))
    .map((one) => parseFloat(getComputedStyle(one).fontSize) * one.currentCSSZoom))"""
CUT = """() => [...document.querySelectorAll("dd, td:not(.c-tag), th, h1, h2")]
    .filter((one) => one.checkVisibility() && one.scrollWidth > one.clientWidth + 1).map((one) => one.outerHTML)"""


@pytest.mark.parametrize("size", [(1280, 800), (1920, 1080), (1080, 1920)], ids=lambda size: f"{size[0]}x{size[1]}")
def test_a_wall_has_large_type_and_no_controls_and_stays_on(
    chromium: Browser, place: Place, size: tuple[int, int]
) -> None:
    names = [f"cart-{number}" for number in range(6)]
    place.move(*names, x=np.arange(6.0), y=[1.0, -2.0, 3.0, 0.0, 2.0, -1.0], sigma_pos=0.12, speed=1.2)
    with watched_page(
        chromium,
        f"{place.url}?kiosk#tag=cart-3",
        size=size,
        prepare=lambda page: page.add_init_script(WAKE),
    ) as page:
        expect(page.page.locator("#detail h2")).to_have_text("cart-3")
        page.wait_for_map(6)
        places = [tag["pixel"] for tag in page.tags().values()]
        assert max(x for x, _ in places) - min(x for x, _ in places) > 150  # the map fits the tags
        assert page.page.evaluate(CONTROLS) == []
        assert page.page.evaluate(SMALLEST) >= 16
        assert page.page.evaluate(CUT) == []
        assert page.page.evaluate("wakes") >= 1
        ratio = page.page.evaluate("document.getElementById('map').width / document.getElementById('map').clientWidth")
        assert ratio >= 1.5  # the map is as sharp as the type is large
        assert page.errors == []


def test_the_wall_shows_one_tag_after_another_and_escape_leaves_it(chromium: Browser, place: Place) -> None:
    place.move("a", "b", "c", x=[1.0, 2.0, 3.0], y=1.0)
    with watched_page(chromium, f"{place.url}?kiosk=tags&every=2#text=") as page:
        name = page.page.locator("#detail h2")
        for tag in ("a", "b", "c", "a"):
            expect(name).to_have_text(tag)
        page.page.keyboard.press("Escape")
        expect(page.page).not_to_have_url(re.compile("kiosk"))
        expect(page.page.locator("#options")).to_be_visible()


def test_the_dialog_of_the_display_leads_to_the_wall(chromium: Browser, place: Place) -> None:
    place.move("a", x=1.0, y=1.0)
    with watched_page(chromium, f"{place.url}?lang=de#tag=a") as page:
        page.page.get_by_role("button", name="Anzeige").click()
        page.page.get_by_role("link", name="Als Wandanzeige öffnen").click()
        expect(page.page.locator("#options")).to_be_hidden()
        expect(page.page.locator("#detail h2")).to_have_text("a")
        assert "lang=de" in page.page.url
