"""Every text on the page is readable on every size of screen."""

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.estimation.columns import State
from service.dashboard.past_place import wait_for_past
from service.dashboard.place import Place, live_api_bench
from support.browser import WatchedPage, watched_page
from support.http_server import running_server

pytestmark = pytest.mark.browser

SIZES = [(390, 844), (820, 1180), (900, 800), (1024, 768), (1280, 800), (1440, 900)]

CUT_OFF = """() => [...document.querySelectorAll("th, tbody td, tbody .name, #detail dd")]
    .filter((cell) => cell.checkVisibility() && !cell.classList.contains("c-online"))
    .filter((cell) => cell.scrollWidth > cell.clientWidth || cell.scrollHeight > cell.clientHeight + 1)
    .map((cell) => `${cell.className || cell.dataset.part}: ${cell.textContent}`)"""
BOXES = """() => {
    const map = document.getElementById("map").getBoundingClientRect();
    const box = (element) => {
        const { left, top, right, bottom } = element.getBoundingClientRect();
        return [left - map.left, top - map.top, right - map.left, bottom - map.top];
    };
    return {
        map: [0, 0, map.width, map.height],
        covering: [...document.querySelectorAll(".map > :not(canvas)")].filter((e) => e.checkVisibility()).map(box),
        labels: dropanchor.drawing().labels,
        dots: dropanchor.tags().map(({ pixel: [x, y] }) => [x - 6, y - 6, x + 6, y + 6]),
    };
}"""
BOX = """(selector) => {
    const { left, right, top, bottom } = document.querySelector(selector).getBoundingClientRect();
    return { left, right, height: Math.min(bottom, innerHeight) - top };
}"""


def every_size(page: WatchedPage) -> Iterator[str]:
    """Show a page in every size, one after another. Yield the name of each."""
    for width, height in SIZES:
        page.page.set_viewport_size({"width": width, "height": height})
        page.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        yield f"{width}x{height}"


@contextmanager
def unfolded_tools(page: WatchedPage) -> Iterator[None]:
    """Unfold the tools where one button stands for them, and fold them again."""
    fold = page.page.locator("#tools-fold")
    if fold.is_visible():
        fold.click()
    yield
    if fold.is_visible():
        fold.click()


def test_no_number_is_cut_off(chromium: Browser, place: Place) -> None:
    place.move("a", x=-13.45, y=-56.78, speed=-10.31, sigma_pos=0.25, cov=np.eye(3), range=45.67, heading=2.0)
    place.move("b", x=-123.45, y=-9876.5, speed=-0.31, sigma_pos=123.4, cov=np.eye(3) * 1e4)
    place.move("c", x=-54321.0, y=98765.4, speed=12.5, sigma_pos=1234.5, state=State.DEGRADED)
    place.move("d", x=1.0, y=1.0, state=State.AMBIGUOUS)
    place.move("e", state=State.INITIALISING, x=np.nan, y=np.nan)
    with watched_page(chromium, place.url) as page:
        page.page.locator("tr[data-tag='e']").wait_for()
        for size in every_size(page):
            for column in ("x", "age"):  # the arrow of the sort direction needs space as well
                if page.page.locator(f"th.c-{column}").is_visible():
                    page.page.locator(f"th.c-{column} button").click()
                assert page.page.evaluate(CUT_OFF) == [], size
        page.page.locator("tr[data-tag='a'] td.c-x").click()
        page.page.locator("#detail").wait_for()
        for size in every_size(page):
            assert page.page.evaluate(CUT_OFF) == [], size
            assert page.page.evaluate("document.getElementById('detail').clientHeight") > 150, size
            assert page.page.evaluate("document.documentElement.scrollHeight <= innerHeight"), size


def test_names_that_differ_at_the_end_look_different(chromium: Browser, place: Place) -> None:
    names = [f"warehouse-north-hall-forklift-{i}-of-the-early-shift-{i}" for i in (1, 2, 11)] + ["WWWWWWWWWWWW" * 4]
    place.move(*names, x=np.arange(4.0), y=1.0)
    with watched_page(chromium, place.url) as page:
        page.page.locator(f"tr[data-tag='{names[2]}']").wait_for()
        cells = page.page.locator("tbody tr:visible td.c-tag")
        for size in every_size(page):
            assert page.page.evaluate(CUT_OFF) == [], size
            assert len(set(cells.all_inner_texts())) == len(names), size
        assert {cell.get_attribute("title") for cell in cells.all()} == set(names)
        assert {cell.get_attribute("aria-label") for cell in cells.all()} == set(names)
        cells.first.click()
        title = page.page.locator("#detail h2")
        for size in every_size(page):
            assert title.inner_text() in names
            assert title.evaluate("title => title.scrollWidth <= title.clientWidth"), size


def overlap(a: list[float], b: list[float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def misplaced(page: WatchedPage) -> list[list[float]]:
    """Return the boxes of dots and labels that reach beyond the map or below an element on it."""
    boxes = page.page.evaluate(BOXES)
    left, top, right, bottom = boxes["map"]
    assert boxes["covering"]
    return [
        box
        for box in boxes["dots"] + boxes["labels"]
        if not (left <= box[0] and top <= box[1] and box[2] <= right and box[3] <= bottom)
        or any(overlap(box, other) for other in boxes["covering"])
    ]


def test_show_all_keeps_every_tag_and_label_clear_of_the_edges_and_the_buttons(chromium: Browser, place: Place) -> None:
    corners = [(-9.0, -6.0), (9.0, -6.0), (9.0, 6.0), (-9.0, 6.0), (9.0, 0.0), (0.0, 6.0)]
    x, y = zip(*corners, strict=True)
    names = [f"forklift-{i}" for i in range(len(corners))]
    place.move(*names, x=x, y=y)
    with watched_page(chromium, place.url) as page:
        for size in every_size(page):
            place.move(*names, x=x, y=y)
            page.wait_for_map(len(corners))
            with unfolded_tools(page):
                page.page.locator("#zoom-in").click()
                page.page.locator("#zoom-in").click()
                page.page.locator("#fit").click()
            page.wait_for_map(len(corners))
            page.wait_for("dropanchor.drawing().labels.length >= 4 && dropanchor.drawing().still")
            assert misplaced(page) == [], size
            for step in range(1, 20, 2):  # also while the tags spread
                wider = [at * (1 + step / 40) for at in x]
                place.move(*names, x=wider, y=y)
                page.wait_for(f"dropanchor.tags()[1].x === Math.fround({wider[1]}) && dropanchor.drawing().still")
                assert misplaced(page) == [], size


def test_the_label_of_a_selected_tag_at_the_edge_stays_on_the_map(chromium: Browser, place: Place) -> None:
    place.move("a-tag-with-a-long-name-that-is-as-wide-as-a-telephone-is-64-cha", x=0.0, y=1.0)
    with watched_page(chromium, place.url, size=(390, 844)) as page:
        page.wait_for_map(1)
        page.page.locator("tbody tr:visible").click()
        page.wait_for_map(1)
        assert len(page.page.evaluate("dropanchor.drawing().labels")) == 1
        assert misplaced(page) == []


def heading_of(page: WatchedPage, tag: str) -> str:
    page.page.locator(f"tr[data-tag='{tag}']").click()
    page.wait_for("document.querySelector('[data-part=\"v-heading\"]').textContent !== '–'")
    return page.page.locator("[data-part='v-heading']").inner_text()


def test_a_heading_is_shown_clockwise_from_north_and_sent_counter_clockwise_from_east(
    chromium: Browser, place: Place
) -> None:
    place.move("cart", x=1.0, y=1.0, heading=math.radians(113), yaw_rate=-0.5)
    with watched_page(chromium, place.url) as page:
        assert heading_of(page, "cart") == "337° NNW"
        assert page.page.locator("[data-part='v-turn']").inner_text() == "29 °/s right"
        sent = page.page.evaluate("fetch('api/v1/tags/cart/pose').then((answer) => answer.json())")
        assert sent["heading_rad"] == pytest.approx(math.radians(113), abs=1e-4)


def test_the_heading_on_a_rotated_site_counts_from_true_north(chromium: Browser) -> None:
    turned = Georeference(lat=52.0, lon=13.0, rotation_rad=math.radians(30))
    bench = live_api_bench(Site(anchors=[Anchor(id="17")], georeference=turned))
    with running_server(bench.app(DASHBOARD), bench.stopping) as port:
        place = Place(bench, f"http://127.0.0.1:{port}/")
        place.move("cart", x=1.0, y=1.0, heading=math.radians(20))
        with watched_page(chromium, place.url) as page:
            page.wait_for("document.getElementById('site').textContent")
            assert heading_of(page, "cart") == "40° NE"
            assert page.page.locator("[data-part='n-x']").inner_text() == "x"


@pytest.mark.parametrize("size", [(640, 400), (844, 390)], ids=["200 % zoom", "phone on its side"])
def test_little_height_is_enough_for_map_details_and_past_which_back_closes_one_by_one(
    chromium: Browser, past: tuple[Place, int], size: tuple[int, int]
) -> None:
    place, _ = past
    with watched_page(chromium, place.url, size=size) as page:
        row = page.page.locator("tr[data-tag='first']")
        row.wait_for()
        tools, side = page.page.evaluate(BOX, "#tools"), page.page.evaluate(BOX, "aside")
        assert page.page.evaluate(BOX, "#map")["height"] > 300
        assert tools["right"] < side["left"] + 1
        page.page.locator("#history").click()
        wait_for_past(page, 3)
        assert page.page.evaluate(BOX, "#map")["height"] > 200
        row.click()
        expect(page.page.locator("#detail h2")).to_have_text("first")
        assert page.page.evaluate(BOX, "#detail")["height"] > 150
        page.wait_for("history.state?.is === 'above' && location.hash.includes('tag=first')")
        page.page.go_back()
        expect(page.page.locator("#detail")).to_be_hidden()
        assert page.page.evaluate("dropanchor.past()") is not None
        page.wait_for("history.state?.is === 'above'")
        page.page.go_back()
        expect(page.page.locator("#past")).to_be_hidden()
        row.click()
        page.wait_for("history.state?.is === 'above'")
        page.page.locator("#detail [data-part='close']").click()
        page.wait_for("history.state?.is === 'below'")  # nothing is open, so nothing is to be closed
        assert page.errors == []
