"""What is wrong now is first on the page: found among hundreds of tags, acknowledged, muted, gone when it is over."""

import re
import time

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.zones import EventType, Severity
from dropanchor_service.estimation.columns import State
from dropanchor_service.events.drafts import Draft
from service.dashboard.zone_place import ZonePlace, disc, served, zone_place
from support.axe import violations
from support.browser import WatchedPage, watched_page

pytestmark = pytest.mark.browser

TAGS = 300
SECOND = 10**9


def busy_place() -> ZonePlace:
    """Return a place with 300 tags: one is lost, one in a zone that alarms, and one too fast in a zone that warns."""
    place = zone_place()
    place.put(
        disc("press", 100.0, 0.0, 5.0, name="Press 4", enter_severity=Severity.ALARM),
        disc("lane", -100.0, 0.0, 5.0, name="Slow lane", speed_mps=1.0, speed_severity=Severity.WARNING),
    )
    for number in range(TAGS):
        place.move(f"cart-{number}", x=float(number % 20), y=float(number // 20))
    return place


def top_rows(page: WatchedPage, count: int) -> list[str]:
    rows = page.page.locator("#table tbody tr:not([hidden]) .name")
    return [rows.nth(number).inner_text() for number in range(count)]


def test_trouble_is_seen_among_hundreds_of_tags_acknowledged_muted_and_over(chromium: Browser, axe: str) -> None:
    place = busy_place()
    with served(place), watched_page(chromium, place.url) as page:
        alarms, chip = page.page.get_by_role("region", name="Alarms"), page.page.get_by_role("button", name="Alarms")
        page.wait_for(f"dropanchor.tags().length === {TAGS} && dropanchor.events()")
        assert page.page.title() == "Dropanchor"
        expect(alarms).to_be_hidden()
        page.page.locator("#options").click()
        page.page.get_by_label("Sound when an alarm begins").check()
        page.page.get_by_role("group", name="Columns of the list").get_by_label("Zone").check()
        page.page.get_by_role("group", name="Columns of the list").get_by_label("Speed").uncheck()
        page.page.keyboard.press("Escape")
        page.wait_for("dropanchor.alarms().sounds === 1")  # how it sounds

        place.move("cart-207", state=State.LOST)
        place.go("cart-111", 100.0, 0.0, state=State.TRACKING)
        place.go("cart-55", -100.0, 0.0, speed=3.0, state=State.TRACKING)
        expect(page.page).to_have_title("(2) Dropanchor")
        expect(chip).to_contain_text("2")
        assert page.page.evaluate("dropanchor.alarms().tags") == {"cart-111": "alarm", "cart-55": "warning"}
        page.wait_for("dropanchor.alarms().sounds === 2")  # a warning makes none
        expect(alarms.get_by_role("listitem").first).to_contain_text("cart-111 entered Press 4")
        expect(alarms.get_by_role("listitem").last).to_contain_text("cart-55 is too fast in Slow lane: 3.0 m/s")
        page.wait_for("document.querySelector('#table tr:nth-child(3)').dataset.tag === 'cart-207'")
        assert top_rows(page, 4) == ["cart-111", "cart-55", "cart-207", "cart-0"]
        expect(page.page.get_by_role("gridcell", name="cart-111, alarm")).to_be_visible()
        page.wait_for("dropanchor.drawing().still")
        x, y = page.tags()["cart-111"]["pixel"]
        red, green, blue, _ = page.pixel(x + 12, y)
        assert red > 2 * max(green, blue), "a red ring"
        assert violations(page.page, axe) == []
        page.page.emulate_media(media="print")
        expect(page.page.locator("#tools")).to_be_hidden()
        expect(alarms.get_by_role("button", name="Acknowledge: cart-111 entered Press 4")).to_be_hidden()
        expect(alarms).to_contain_text("cart-111 entered Press 4")
        page.page.emulate_media(media="screen")

        chip.click()
        expect(page.page.locator("#count")).to_have_text("2 of 300 tags")
        chip.click()
        page.page.locator("#filter").fill("zone:press")
        expect(page.page.locator("#count")).to_have_text("1 of 300 tags")
        expect(page.page.locator("#table tbody tr:not([hidden]) .c-zone")).to_have_text("Press 4")
        expect(page.page.get_by_role("columnheader", name="v m/s")).to_be_hidden()
        page.page.locator("#filter").fill("")
        page.page.locator("#filter").blur()
        page.page.keyboard.press("a")
        expect(alarms.get_by_role("button", name="Acknowledge: cart-111 entered Press 4")).to_be_focused()
        alarms.get_by_label("Note on: cart-111 entered Press 4").fill("the driver knows")
        page.page.keyboard.press("Enter")
        expect(page.page).to_have_title("(1) Dropanchor")
        expect(alarms.get_by_role("listitem").last).to_contain_text("Acknowledged by somebody")
        expect(alarms.get_by_role("listitem").last).to_contain_text("the driver knows")

        alarms.get_by_role("button", name="Mute Slow lane for 1 h").click()
        expect(page.page).to_have_title("Dropanchor")
        expect(alarms).to_contain_text("muted until")
        assert place.zones["lane"].muted_until_ns is not None
        page.page.keyboard.press("Control+z")
        expect(page.page).to_have_title("(1) Dropanchor")
        assert place.zones["lane"].muted_until_ns is None
        page.page.locator("#table").get_by_text("cart-55", exact=True).click()
        page.page.keyboard.press("a")
        expect(page.page).to_have_title("Dropanchor")

        place.go("cart-111", 0.0, 0.0, state=State.TRACKING)
        place.go("cart-55", -100.0, 0.0, speed=0.1, state=State.TRACKING)
        expect(alarms).to_be_hidden()
        assert page.page.evaluate("dropanchor.alarms().tags") == {}
        assert page.errors == []


def test_events_are_found_by_tag_kind_zone_and_time_are_not_cut_and_are_saved(chromium: Browser) -> None:
    place = busy_place()
    now_ns = time.time_ns()
    drafts = []
    for number in range(700):
        t_ns = now_ns - (700 - number) * SECOND
        data = {"t_ns": t_ns, "since_ns": t_ns, "zone": "lane" if number % 70 == 0 else "press"}
        drafts.append(Draft((EventType.ZONE_ENTER, EventType.ZONE_EXIT)[number % 2], f"cart-{number % 5}", data))
    place.parts.store.commit(drafts, {})
    with served(place), watched_page(chromium, place.url) as page:
        page.wait_for(f"dropanchor.tags().length === {TAGS} && dropanchor.events()")
        page.page.locator("#events summary").click()
        events, form = page.page.locator("#events"), page.page.get_by_role("form", name="Which events")
        lines, older = events.locator("ol > li"), events.get_by_role("button", name="Show older ones")
        expect(lines).to_have_count(100)
        for count in (500, 700):
            older.click()
            expect(lines).to_have_count(count)
        expect(older).to_be_hidden()
        form.get_by_role("searchbox", name="Tag").fill("CART-3")
        form.get_by_label("Type").select_option("Left a zone")
        expect(lines).to_have_count(70)
        expect(lines.first).to_contain_text("cart-3 left press")
        expect(lines.first.locator("time")).to_have_attribute("title", re.compile("(UTC|GMT)"))
        place.parts.store.commit([Draft(EventType.ZONE_EXIT, tag, drafts[-1].data) for tag in ("cart-3", "cart-4")], {})
        expect(lines).to_have_count(71)
        with page.page.expect_download() as download:
            form.get_by_role("button", name="CSV").click()
        assert len(download.value.path().read_text().splitlines()) == 1 + 71
        form.get_by_role("button", name="Show all").click()
        form.get_by_label("Zone", exact=True).select_option("Slow lane")
        expect(lines).to_have_count(10)
        then = page.page.evaluate(
            "(ms) => new Date(ms - new Date(ms).getTimezoneOffset() * 60000).toISOString().slice(0, 19)",
            (now_ns - 350 * SECOND) // 10**6,
        )
        form.get_by_label("From").fill(then)
        form.get_by_label("From").blur()
        expect(lines).to_have_count(5)
        assert page.errors == []


def test_the_wall_shows_alarms_and_the_time_and_nothing_to_press(chromium: Browser) -> None:
    place = busy_place()
    place.go("cart-111", 100.0, 0.0, state=State.TRACKING)
    with served(place), watched_page(chromium, f"{place.url}?kiosk&lang=de", size=(1920, 1080)) as page:
        alarms = page.page.locator("#alarms")
        expect(alarms).to_contain_text("cart-111 hat Press 4 betreten")
        expect(page.page).to_have_title("(1) Dropanchor")
        expect(page.page.locator("#wall-clock")).to_contain_text(":")
        expect(alarms.locator("form")).to_be_hidden()
        assert page.errors == []
