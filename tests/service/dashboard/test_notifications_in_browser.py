"""The browser notifies about chosen events, and is asked for permission by a click alone."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from service.dashboard.zone_place import ZonePlace, served, square, zone_place
from support.browser import watched_page

pytestmark = pytest.mark.browser

BROWSER = """
    window.shown = [];
    window.asked = [];
    window.Notification = class {
        static permission = "default";
        static async requestPermission() {
            window.asked.push(navigator.userActivation.isActive);
            return (this.permission = "%s");
        }
        constructor(title, options) { Object.assign(this, { title, ...options }); window.shown.push(this); }
        close() {}
    };
"""
SHOWN = "shown.map(({ title }) => title)"


@pytest.fixture
def yard() -> Iterator[ZonePlace]:
    place = zone_place()
    place.put(square("yard", 1.0, 1.0, name="Yard"))
    place.go("cart-3", -10.0, -10.0)
    with served(place):
        yield place


def granting(page: Page) -> None:
    page.add_init_script(BROWSER % "granted")


def denying(page: Page) -> None:
    page.add_init_script(BROWSER % "denied")


def test_chosen_events_are_notified_and_a_click_shows_them(chromium: Browser, yard: ZonePlace) -> None:
    with watched_page(chromium, yard.url, prepare=granting) as page:
        page.wait_for("dropanchor.events()")
        yard.go("cart-3", 3.0, 3.0)
        page.wait_for("document.querySelectorAll('#events li').length === 1")
        page.page.get_by_role("button", name="Display").click()
        assert page.page.evaluate("asked") == []
        page.page.locator("#notifications").get_by_label("Left a zone").check()
        page.page.keyboard.press("Escape")
        assert page.page.evaluate("asked") == [True]
        yard.go("cart-3", -10.0, -10.0)
        page.wait_for(f"{SHOWN}.length === 1")
        assert page.page.evaluate(SHOWN) == ["cart-3 left Yard"]
        yard.go("cart-3", 3.0, 3.0)
        yard.go("cart-3", -10.0, -10.0)
        page.wait_for(f"{SHOWN}.length === 2")
        assert page.page.evaluate(SHOWN) == ["cart-3 left Yard"] * 2  # nobody chose the entering
        page.page.evaluate("shown[0].onclick()")
        expect(page.page.locator("#detail h2")).to_have_text("cart-3")
        page.page.reload()
        page.page.get_by_role("button", name="Display").click()
        expect(page.page.locator("#notifications").get_by_label("Left a zone")).to_be_checked()
        assert page.page.evaluate("asked") == []
        assert page.errors == []


def test_a_storm_of_events_makes_one_notification(chromium: Browser, yard: ZonePlace) -> None:
    tags = [f"tag-{number}" for number in range(10)]
    yard.move(*tags, x=-10.0, y=-10.0)
    yard.watch.turn()
    with watched_page(chromium, yard.url, prepare=granting) as page:
        page.wait_for("dropanchor.events()")
        page.page.get_by_role("button", name="Display").click()
        page.page.locator("#notifications").get_by_label("Entered a zone").check()
        yard.move(*tags, x=3.0, y=3.0)
        yard.watch.turn()
        page.wait_for(f"{SHOWN}.length > 0")
        page.page.wait_for_timeout(1500)
        assert page.page.evaluate(SHOWN) == ["10 events"]


def test_a_refused_permission_is_explained_and_nothing_is_chosen(chromium: Browser, yard: ZonePlace) -> None:
    with watched_page(chromium, yard.url, prepare=denying) as page:
        page.page.get_by_role("button", name="Display").click()
        page.page.locator("#notifications").get_by_label("Battery low").click()
        expect(page.page.locator("#notifications [role='alert']")).to_contain_text("change that in its settings")
        expect(page.page.locator("#notifications").get_by_label("Battery low")).not_to_be_checked()
