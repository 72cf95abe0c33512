"""One click adds an anchor that a tag hears and the site lacks."""

import time
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from service.dashboard.place import Place, live_api_bench
from support.browser import open_page, watched_page
from support.http_server import running_server

pytestmark = pytest.mark.browser


def hear(place: Place, anchor: int) -> None:
    """Give the site a tag that hears an anchor."""
    place.move("cart", x=1.0, y=2.0)
    tag = place.bench.answers.tags.register("cart")
    place.bench.answers.tags.unknown_anchors.record(tag.row, tag.name, anchor, str(anchor), time.time_ns())


def test_the_anchor_is_placed_at_the_centre_of_the_map_or_at_coordinates(chromium: Browser, place: Place) -> None:
    hear(place, 9)
    with watched_page(chromium, place.url) as page:
        page.wait_for_map(1)
        page.page.locator("tr[data-tag='cart']").click()
        page.page.get_by_role("button", name="Add anchor 9").click()
        form = page.page.get_by_role("form", name="Place the anchor")
        x = float(form.get_by_label("x").input_value())
        centre = page.page.evaluate("document.getElementById('map').clientWidth / 2")
        cart = page.tags()["cart"]
        assert x == pytest.approx(1.0 + (centre - cart["pixel"][0]) / 40, abs=50)
        form.get_by_label("x").fill("4.5")
        form.get_by_label("height").fill("2.5")
        form.get_by_role("button", name="Add", exact=True).click()
        expect(page.page.get_by_text("Anchor 9 added.")).to_be_visible()
        (added,) = [anchor for anchor in place.bench.answers.site.site.anchors if anchor.id == "9"]
        assert (added.x, added.z) == (4.5, 2.5)
        page.page.locator("tr[data-tag='cart']").click()
        expect(page.page.get_by_role("button", name="Add anchor 9")).to_be_hidden()
        assert page.errors == []


def test_a_tag_that_hears_only_anchors_of_the_site_offers_none(chromium: Browser, place: Place) -> None:
    place.move("cart", x=1.0, y=2.0)
    with watched_page(chromium, place.url) as page:
        page.page.locator("tr[data-tag='cart']").click()
        page.page.locator("#detail").wait_for()
        assert page.page.get_by_role("button", name="Add anchor").is_hidden()


def test_a_key_that_may_only_read_is_offered_no_anchor(chromium: Browser, tmp_path: Path) -> None:
    bench = live_api_bench()
    keys = ApiKeys(tmp_path)
    secret = keys.add("reader", Scope.READ)
    app = bench.app(DASHBOARD, authenticator=Authenticator({SOURCE: keys}))
    with running_server(app, bench.stopping) as port, open_page(chromium, f"http://127.0.0.1:{port}/") as page:
        hear(Place(bench, ""), 9)
        page.page.locator("#key").fill(secret)
        page.page.get_by_role("button", name="Open").click()
        page.page.locator("tr[data-tag='cart']").click()
        expect(page.page.locator("[data-part='hint']")).to_contain_text("9")
        expect(page.page.get_by_role("button", name="Add anchor 9")).to_be_hidden()
