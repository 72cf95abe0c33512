"""The page shows what tags report about themselves, counts those that need care, and shows only these on demand."""

import time

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_service.estimation.plausibility.verdicts import SENTENCES, Finding
from dropanchor_service.store.clock_offsets import ClockOffset, MotionOffset, NoClockOffsets
from service.dashboard.place import Place
from support.browser import watched_page

pytestmark = pytest.mark.browser


def test_tags_that_need_care_are_counted_and_filtered_and_the_panel_says_what_they_need(
    chromium: Browser, place: Place
) -> None:
    place.move("empty", "full", x=1.0, y=2.0)
    tags, health = place.bench.answers.tags, place.bench.answers.health
    now_ns = time.time_ns()
    health.record(tags.register("full").row, {"battery_fraction": 0.93, "firmware": "2.0"}, now_ns)
    with watched_page(chromium, place.url) as watched:
        page = watched.page
        expect(page.locator("tr[data-tag]:visible")).to_have_count(2)
        expect(page.locator("#care")).to_be_hidden()
        health.record(tags.register("empty").row, {"battery_fraction": 0.08, "rssi_dbm": -82.0}, now_ns)
        chip = page.locator("#care")
        expect(chip).to_have_text("Needs care 1")
        chip.click()
        expect(page.locator("tr[data-tag]:visible")).to_have_count(1)
        page.locator("tr[data-tag='empty']").click()
        expect(page.locator("[data-part='care']")).to_have_text("The battery is at 8%: charge it.")
        expect(page.locator("[data-part='health']")).to_contain_text("8 %")
        expect(page.locator("[data-part='health']")).to_contain_text("−82 dBm")
        page.locator("#show-all").click()
        page.locator("tr[data-tag='full']").click()
        expect(page.locator("[data-part='care']")).to_be_hidden()
        expect(page.locator("[data-part='health']")).to_contain_text("2.0")


class Offsets(NoClockOffsets):
    """One offset, of the first tag."""

    def clock_offsets(self, _now_ns: int) -> dict[int, ClockOffset]:
        return {0: ClockOffset(0.8, 0.12, MotionOffset(-0.1, 0.25))}


def test_the_panel_shows_how_far_the_clocks_of_a_tag_are_apart_and_what_to_do(chromium: Browser, place: Place) -> None:
    place.bench.answers.clock_offsets = Offsets()
    place.move("phone", x=1.0, y=2.0)
    with watched_page(chromium, place.url) as watched:
        watched.page.locator("tr[data-tag='phone']").click()
        health = watched.page.locator("[data-part='health']")
        expect(health).to_contain_text("0.80 s ahead of the ranges ± 0.12 s")
        expect(watched.page.locator("[data-part='care']")).to_contain_text("0.8 s ahead of that of its ranges")
        expect(health).to_contain_text("0.10 s behind the ranges ± 0.25 s")


def test_a_unit_that_a_tag_gets_wrong_is_accepted_with_one_click_and_may_be_undone(
    chromium: Browser, place: Place
) -> None:
    place.move("cart", x=1.0, y=2.0)
    tags, site = place.bench.answers.tags, place.bench.answers.site
    sentence = SENTENCES["acc_in_g"]
    tags.rows.findings.set(tags.register("cart").row, [Finding("acc_in_g", sentence, ("acc_unit", "g"))])
    with watched_page(chromium, place.url) as watched:
        page = watched.page
        page.locator("tr[data-tag='cart']").click()
        care = page.locator("[data-part='care']")
        expect(care).to_contain_text(sentence)
        care.get_by_role("button", name="Set acc_unit = g").click()
        expect(page.locator("#outcome")).to_contain_text("cart: acc_unit = g set.")
        assert site.tag_settings("cart").acc_unit == "g"
        page.keyboard.press("Control+z")
        expect(page.locator("#outcome")).to_contain_text("Undone")
        assert site.tag_settings("cart").acc_unit == "m/s2"
