"""The page shows zones and events, live."""

import re
import time
from collections.abc import Iterator
from contextlib import ExitStack
from threading import Event

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_service.estimation.columns import State
from service.dashboard.zone_place import ZonePlace, disc, served, square, zone_place
from support.browser import WatchedPage, watched_page

pytestmark = pytest.mark.browser

COLOUR = "#d02090"
STROKE = """([r, g, b]) => {
    const map = document.getElementById("map");
    const { data } = map.getContext("2d").getImageData(0, 0, map.width, map.height);
    let count = 0;
    for (let i = 0; i < data.length; i += 4) if (data[i] === r && data[i + 1] === g && data[i + 2] === b) count++;
    return count;
}"""


@pytest.fixture
def yard() -> Iterator[ZonePlace]:
    place = zone_place()
    place.put(square("yard", 1.0, 1.0, name="Yard", colour=COLOUR), disc("dock", -3.0, 0.0, 1.5, name="Dock"))
    place.go("cart-3", -10.0, -10.0)
    with served(place):
        yield place


def strokes(page: WatchedPage) -> int:
    """Return how many pixels of the map have exactly the colour of the yard."""
    page.wait_for("dropanchor.drawing().still")
    count: int = page.page.evaluate(STROKE, [0xD0, 0x20, 0x90])
    return count


def test_a_zone_is_dashed_until_a_tag_enters_and_its_list_counts_the_tags(chromium: Browser, yard: ZonePlace) -> None:
    with watched_page(chromium, yard.url) as page:
        page.wait_for("dropanchor.events() && dropanchor.zones().yard === 0")
        page.page.locator("#zone-list summary").click()
        line = page.page.locator("#zone-list li", has_text="Yard")
        expect(line).to_contain_text("empty")
        line.get_by_role("button", name="Yard", exact=True).click()
        dashed = strokes(page)
        assert dashed > 100
        yard.go("cart-3", 3.0, 3.0)
        page.wait_for("dropanchor.zones().yard === 1")
        expect(line).to_contain_text("1 tag inside")
        assert strokes(page) > 1.3 * dashed
        yard.put(square("yard", 1.0, 1.0, name="Court", colour="#112233"))
        expect(page.page.locator("#zone-list li", has_text="Court")).to_be_visible()
        page.wait_for(f"({STROKE})([0xd0, 0x20, 0x90]) === 0")


def test_who_is_where_names_the_tags_in_each_zone_longest_first_and_can_be_printed(
    chromium: Browser, yard: ZonePlace
) -> None:
    for tag in ("late", "early"):
        yard.move(tag, x=-10.0, y=-10.0)
    fresh_ns = time.time_ns() + 600_000_000_000  # their states stay what they are, however long the page takes
    yard.go("early", 3.0, 3.0, t_ns=fresh_ns)
    yard.go("late", 2.0, 2.0, t_ns=fresh_ns + 1_000_000_000, state=State.COASTING)
    with watched_page(chromium, yard.url, reduced_motion="reduce") as page:
        page.page.locator("#zone-list summary").click()
        page.page.locator("#zone-list li", has_text="Yard").get_by_role("button", name="2 tags inside").click()
        dialog = page.page.get_by_role("dialog", name="Who is where")
        expect(dialog.locator("h3")).to_have_text(["Yard: 2", "Dock: 0", "In no zone: 1"])
        expect(dialog.locator("section").nth(0).locator("li")).to_have_text(
            [re.compile(r"^early since .*[\d:]{8}$"), re.compile(r"^late since .*[\d:]{8} · Coasting$")]
        )
        yard.go("late", -10.0, -10.0, t_ns=fresh_ns + 2_000_000_000)
        expect(dialog.locator("h3")).to_have_text(["Yard: 1", "Dock: 0", "In no zone: 2"])
        page.page.emulate_media(media="print")
        expect(page.page.locator("main")).to_be_hidden()
        expect(dialog.get_by_text("early")).to_be_visible()
        expect(dialog.get_by_role("button", name="Print")).to_be_hidden()
        page.page.emulate_media(media="screen")
        dialog.get_by_role("button", name="early").click()
        expect(page.page.locator("#detail h2")).to_have_text("early")
        assert page.errors == []


def test_the_lists_of_the_present_are_hidden_while_the_page_shows_the_past(chromium: Browser, yard: ZonePlace) -> None:
    yard.go("cart-3", 3.0, 3.0)
    with watched_page(chromium, yard.url) as page:
        page.wait_for("dropanchor.events() && dropanchor.zones().yard === 1")
        lists = [page.page.locator("#events"), page.page.locator("#zone-list")]
        lists[1].locator("summary").click()
        sentence = page.page.get_by_text("Zones and alerts are hidden")
        expect(sentence).to_be_hidden()
        page.page.locator("#history").click()
        expect(sentence).to_be_visible()
        expect(lists[0]).to_be_visible()
        expect(lists[1]).to_be_hidden()
        page.page.locator("#history").click()
        expect(sentence).to_be_hidden()
        expect(lists[1]).to_contain_text("1 tag inside")
        lists[1].get_by_role("button", name="Edit Yard").click()
        expect(page.page.get_by_role("form", name="Zone", exact=True)).to_be_visible()
        page.page.locator("#history").click()
        expect(page.page.get_by_role("form", name="Zone", exact=True)).to_be_hidden()
        assert not page.page.evaluate("dropanchor.panels().zone")


def test_events_come_live_and_newest_first_and_a_click_selects_tag_and_zone(chromium: Browser, yard: ZonePlace) -> None:
    yard.go("cart-3", 3.0, 3.0)
    with watched_page(chromium, yard.url) as page:
        page.wait_for("dropanchor.events() && 'yard' in dropanchor.zones()")
        events = page.page.locator("#events")
        expect(events.locator("summary")).to_contain_text("cart-3 entered Yard")
        events.locator("summary").click()
        expect(events.get_by_role("listitem")).to_have_count(1)
        yard.go("cart-3", -3.0, 0.0)
        expect(events.get_by_role("listitem")).to_have_count(3)
        texts = events.get_by_role("listitem").all_inner_texts()
        assert {text.split("\n")[0] for text in texts[:2]} == {"cart-3 left Yard", "cart-3 entered Dock"}
        assert "P 1.00" in texts[2] or "P 0.9" in texts[2]
        events.get_by_role("button", name="cart-3 left Yard").click()
        expect(page.page.locator("#detail")).to_contain_text("cart-3")
        events.get_by_role("button", name="cart-3 left Yard").press("Tab")
        page.page.locator("#zone-list summary").click()
        expect(page.page.get_by_role("button", name="Yard", exact=True)).to_have_attribute("aria-pressed", "true")
        assert page.errors == []


def test_nothing_is_counted_while_the_connection_is_lost_and_missed_events_come_with_it(chromium: Browser) -> None:
    place = zone_place()
    place.put(square("yard", 1.0, 1.0, name="Yard", colour=COLOUR))
    place.go("cart-3", 3.0, 3.0)
    with ExitStack() as pages:
        with served(place) as port:
            page = pages.enter_context(watched_page(chromium, place.url))
            page.wait_for("dropanchor.events() && dropanchor.zones().yard === 1")
            page.page.locator("#zone-list summary").click()
        page.page.locator("#lost").wait_for(state="visible")
        expect(page.page.locator("#zone-list li")).to_contain_text("out of date")
        expect(page.page.locator("#events summary")).to_contain_text("out of date")
        page.wait_for(f"({STROKE})([0xd0, 0x20, 0x90]) === 0")
        place.go("cart-3", -10.0, -10.0)
        place.bench.stopping = Event()
        with served(place, port=port):
            expect(page.page.locator("#events summary")).to_contain_text("cart-3 left Yard")
            expect(page.page.locator("#zone-list li")).to_contain_text("empty")
