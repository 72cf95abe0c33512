"""The accessibility checker axe-core finds no violation in the views of alerts."""

import pytest
from playwright.sync_api import Browser

from dropanchor_schemas.zones import LostRule, TooCloseRule
from service.dashboard.alert_place import alert_place, happen, put_mail
from service.dashboard.zone_place import ZonePlace, served
from support.axe import violations
from support.browser import every_look, watched_page

pytestmark = pytest.mark.browser

WIDER_THAN_ITS_PLACE = """() => [...document.querySelectorAll("#alerts *")]
    .filter((one) => one.checkVisibility() && one.getBoundingClientRect().right > innerWidth + 1)
    .map((one) => one.outerHTML)"""


def busy_place() -> ZonePlace:
    place = alert_place()
    put_mail(place)
    put_mail(place, "night-watch-of-the-northern-hall")
    happen(place, "cart-3", "forklift-north-hall-17")
    place.parts.deliveries.bury("shift", [1, 2], "the mail server answered 550 5.1.1 no such user here")
    rules = place.parts.items.rules
    rules.put(
        "apart", TooCloseRule(type="too_close", id="apart", name="Keep apart", distance_m=3, groups=["forklifts"])
    )
    rules.put("lost", LostRule(type="lost", id="lost", name="Lost for long", after_s=600))
    return place


def test_no_violation_in_the_lists_and_the_forms(chromium: Browser, axe: str) -> None:
    place = busy_place()
    with (
        served(place),
        watched_page(chromium, place.url) as page,
    ):

        def check(view: str, within: str = "#alerts") -> None:
            assert violations(page.page, axe, within) == [], view
            for look in every_look(page.page):
                assert page.page.evaluate(WIDER_THAN_ITS_PLACE) == [], (view, look)

        page.wait_for("dropanchor.events() && dropanchor.destinations().length === 2")
        page.page.locator("#alerts summary").click()
        alerts = page.page.locator("#alerts")
        alerts.get_by_role("button", name="Show what shift did not get").click()
        alerts.get_by_role("list", name="Events that were not delivered").wait_for()
        alerts.get_by_role("button", name="Test shift").click()
        alerts.get_by_text("The test event was not delivered").wait_for()
        check("alerts", "html")
        alerts.get_by_role("button", name="Edit shift").click()
        alerts.get_by_role("button", name="Delete…").click()
        page.page.locator("#confirm").wait_for()
        check("asked", "#confirm")
        page.page.locator("#confirm").get_by_role("button", name="Cancel").click()
        alerts.get_by_label("Addresses").fill("no address")
        alerts.get_by_role("button", name="Save destination").click()
        alerts.get_by_text("'address' is no address such as shift@example.com").wait_for()
        check("refused")
        alerts.get_by_role("button", name="Cancel").click()
        alerts.get_by_role("button", name="New webhook").click()
        alerts.get_by_role("textbox", name="Name").fill("mes")
        alerts.get_by_label("URL").fill("http://10.0.0.1/events")
        alerts.get_by_role("button", name="Save destination").click()
        alerts.get_by_role("button", name="Allow 10.0.0.0/24").wait_for()
        check("webhook")
        alerts.get_by_role("button", name="Cancel").click()
        alerts.get_by_role("button", name="Edit Keep apart").click()
        alerts.get_by_label("Closer than").wait_for()
        check("rule")
