"""A person measures on the map with the mouse and with the keyboard."""

import re

import pytest
from playwright.sync_api import Browser, expect

from service.dashboard.place import Place
from support.browser import watched_page

pytestmark = pytest.mark.browser


def test_clicks_measure_distance_and_bearing_and_select_no_tag(chromium: Browser, place: Place) -> None:
    place.move("west", "north", x=[-10.0, -10.0], y=[0.0, 20.0])
    with watched_page(chromium, place.url) as page:
        page.wait_for_map(2)
        page.page.locator("#measure").click()
        answer = page.page.locator("#measured")
        expect(answer).to_contain_text("Click two or more points")
        box = page.page.locator("#map").bounding_box()
        assert box is not None
        for tag in ("west", "north"):
            x, y = page.tags()[tag]["pixel"]
            page.page.mouse.click(box["x"] + x, box["y"] + y)
        measured = re.fullmatch(r"(\d+\.\d\d) m, 0° N", answer.inner_text())
        assert measured is not None, answer.inner_text()
        assert float(measured[1]) == pytest.approx(20.0, abs=0.3)  # a click has whole pixels
        expect(page.page.locator("#detail")).to_be_hidden()
        page.page.locator("#map").focus()
        page.page.keyboard.press("Enter")
        expect(answer).to_contain_text("in all")
        page.page.keyboard.press("Escape")
        expect(answer).to_be_hidden()
        assert page.errors == []
