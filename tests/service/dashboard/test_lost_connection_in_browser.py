"""After the connection is lost, nothing on the page claims that a pose is current."""

import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from threading import Event

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, Route

from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.estimation.columns import State
from service.dashboard.place import Place, live_api_bench
from support.browser import WatchedPage, watched_page
from support.http_server import running_server

pytestmark = pytest.mark.browser

CLAIM = re.compile(r"tracking|trusted|\blive\b", re.IGNORECASE)
EVERY_TEXT = """() => {
    const texts = [document.title];
    for (const element of document.body.querySelectorAll("*")) {
        if (!element.checkVisibility()) continue;
        for (const { name, value } of element.attributes) {
            if (["title", "alt"].includes(name) || name.startsWith("aria-")) texts.push(value);
        }
        for (const node of element.childNodes) if (node.nodeType === Node.TEXT_NODE) texts.push(node.data);
    }
    return texts;
}"""
BLUE_PIXELS = """() => {
    const map = document.getElementById("map");
    const { data } = map.getContext("2d").getImageData(0, 0, map.width, map.height);
    let count = 0;
    for (let i = 0; i < data.length; i += 4) if (data[i] === 0 && data[i + 1] === 103 && data[i + 2] === 184) count++;
    return count;
}"""


def claims(page: WatchedPage) -> list[str]:
    """Return the texts that claim current poses, including those for screen readers and tooltips."""
    return [text for text in page.page.evaluate(EVERY_TEXT) if CLAIM.search(text)]


@dataclass
class Outage:
    """A page whose service has stopped."""

    place: Place
    page: WatchedPage
    port: int


def show_six(place: Place, page: WatchedPage) -> None:
    place.move(*(f"cart-{i}" for i in range(6)), x=np.arange(6.0), y=1.0, cov=np.eye(3) * 1e-6)
    page.wait_for_map(6)


@contextmanager
def outage(chromium: Browser) -> Iterator[Outage]:
    """Show six tracked tags with one of them selected, then stop the service."""
    bench = live_api_bench()
    bench.answers.tags.register("cart-0")
    bench.answers.tags.presence.set_token("cart-0", True)
    with ExitStack() as pages:
        with running_server(bench.app(DASHBOARD), bench.stopping) as port:
            place = Place(bench, f"http://127.0.0.1:{port}/")
            page = pages.enter_context(watched_page(chromium, place.url))
            show_six(place, page)
            page.page.locator("tr[data-tag='cart-0']").click()
            show_six(place, page)
            page.wait_for(f"({BLUE_PIXELS})() > 0")
            assert len(claims(page)) > 6
        page.page.locator("#lost").wait_for(state="visible")
        yield Outage(place, page, port)


def test_no_text_after_a_lost_connection_claims_that_a_tag_is_tracked(chromium: Browser) -> None:
    with outage(chromium) as lost:
        page = lost.page.page
        assert claims(lost.page) == []
        assert page.title() == "Connection lost · Dropanchor"
        assert [chip.split() for chip in page.locator(".chip:visible").all_inner_texts()] == [
            ["Out", "of", "date", "6"]
        ]
        assert set(page.locator("tbody tr:visible td.c-state").all_inner_texts()) == {"Out of date"}
        assert page.locator("td.c-online.yes").count() == 0
        assert page.locator("[data-part='state']").inner_text() == "Out of date"
        assert page.locator("[data-part='meaning']").inner_text().startswith("No connection to the service")
        assert page.locator("[data-part='v-online']").inner_text() == "–"
        assert {tag["state"] for tag in lost.page.tags().values()} == {"outdated"}


def test_the_map_after_a_lost_connection_has_no_dot_in_the_colour_of_tracking(chromium: Browser) -> None:
    with outage(chromium) as lost:
        lost.page.wait_for("dropanchor.drawing().still")
        assert lost.page.page.evaluate(BLUE_PIXELS) == 0


def test_the_states_come_back_with_the_connection(chromium: Browser) -> None:
    with outage(chromium) as lost:
        lost.place.bench.stopping = Event()
        with running_server(lost.place.bench.app(DASHBOARD), lost.place.bench.stopping, lost.port):
            lost.page.wait_for("dropanchor.status() === 'live'")
            show_six(lost.place, lost.page)
            lost.page.wait_for("dropanchor.tags().every((tag) => tag.state === 'tracking')")
            lost.page.page.locator(".chip[data-state='tracking']", has_text="6").wait_for()
            lost.page.page.locator("td.c-state", has_text=State.TRACKING.name.capitalize()).first.wait_for()
            assert lost.page.page.title() == "Dropanchor"


def test_a_stream_that_nobody_answers_is_asked_for_again(chromium: Browser) -> None:
    bench = live_api_bench()
    asked: list[str] = []

    def leave_the_first_without_an_answer(route: Route) -> None:
        asked.append(route.request.url)
        if len(asked) > 1:
            route.continue_()

    def intercept(page: Page) -> None:
        page.route("**/api/v1/stream*", leave_the_first_without_an_answer)

    with running_server(bench.app(DASHBOARD), bench.stopping) as port:
        place = Place(bench, f"http://127.0.0.1:{port}/")
        with watched_page(chromium, place.url, prepare=intercept) as page:
            show_six(place, page)
            assert len(asked) == 2
