"""axe-core finds no violation where a site is set up: anchors, a conflict, a question, and settings of a tag."""

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.site import Anchor, TagSettings
from service.dashboard.place import Place
from service.dashboard.test_accessibility import assert_no_violation
from support.browser import watched_page

pytestmark = pytest.mark.browser


def test_no_violation_while_a_site_is_set_up(chromium: Browser, place: Place, axe: str) -> None:
    place.bench.answers.site.set_tag("cart", TagSettings(name="Forklift 1", group="forklifts", colour="#d97a0a"))
    place.move("cart", x=1.0, y=1.0)
    with watched_page(chromium, place.url) as page:
        page.page.get_by_role("button", name="Set up anchors").click()
        with page.page.expect_response(lambda response: "/anchors/17" in response.url):
            page.page.get_by_role("button", name="17: ").click()
        form = page.page.get_by_role("form", name="Place the anchor")
        form.get_by_label("x").fill("2")
        place.bench.answers.site.set_anchor(Anchor(id="17", x=1.0))
        form.get_by_role("button", name="Move").click()
        expect(page.page.get_by_role("button", name="Take the newer one")).to_be_visible()
        assert_no_violation(page, axe)
        form.get_by_role("button", name="Delete…").click()
        assert_no_violation(page, axe, "#confirm")
        page.page.get_by_role("dialog").get_by_role("button", name="Cancel").click()
        page.page.locator("tr[data-tag='cart']").click()
        assert_no_violation(page, axe, "#confirm")
        page.page.get_by_role("dialog").get_by_role("button", name="Discard").click()
        page.page.locator("#detail .settings > summary").click()
        page.page.get_by_text("All other settings").click()
        expect(page.page.locator("#setting-height_told")).to_contain_text("In force")
        page.page.get_by_role("button", name="The tag is here…").click()
        expect(page.page.get_by_role("form", name="Where the tag is")).to_be_visible()
        assert_no_violation(page, axe)
