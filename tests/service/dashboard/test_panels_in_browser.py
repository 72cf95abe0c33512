"""One panel is open at a time, any button opens its own, and what is typed is lost only with consent."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, expect

from service.dashboard.panel_place import set_up_place
from service.dashboard.zone_place import ZonePlace
from support.browser import watched_page

pytestmark = pytest.mark.browser

PANELS = """{
    anchors: { by: ["#edit"], shows: "#setup", places: ["side", "map"] },
    plans: { by: ["#edit-plans"], shows: "#plans", places: ["side", "map"] },
    tag: { by: ["tr[data-tag='cart-3'] td"], shows: "#detail", places: ["side"] },
    zone: { by: ["#zone-list summary", "#new-polygon"], shows: "#zone-form", places: ["side", "map"] },
    destination: {
        by: ["#alerts summary", "[data-type=email]"], shows: "[data-part=destination-form]", places: ["side"],
    },
    rule: { by: ["#alerts summary", "[data-part=new-rule] button"], shows: "[data-part=rule-form]", places: ["side"] },
    measure: { by: ["#measure"], shows: "#measured", places: ["map"] },
}"""
CLOSE = """{
    anchors: "#edit", plans: "#edit-plans", tag: "#detail [data-part=close]", zone: "#zone-form [type=reset]",
    destination: "[data-part=destination-form] [type=reset]", rule: "[data-part=rule-form] [type=reset]",
    measure: "#measure",
}"""
WALK = f"""() => {{
    const [panels, close] = [{PANELS}, {CLOSE}];
    const find = (selector) => document.querySelector(selector);
    const press = (selector) => {{
        const target = find(selector);
        if (!target?.checkVisibility()) throw new Error(`${{selector}} cannot be pressed`);
        if (!(target.matches("summary") && target.parentElement.open)) target.click();
    }};
    const open = () => Object.entries(dropanchor.panels()).flatMap(([name, is]) => (is ? [name] : [])).sort();
    const wrong = [];
    for (const [first, a] of Object.entries(panels)) {{
        for (const [second, b] of Object.entries(panels)) {{
            if (first === second || a.by[0] === b.by[0]) continue; // a form of alerts hides the buttons of the other
            [...a.by, ...b.by].forEach(press);
            const isKept = !a.places.some((place) => b.places.includes(place));
            const wanted = (isKept ? [first, second] : [second]).sort();
            if (String(open()) !== String(wanted)) wrong.push([first, second, open()]);
            if (!find(b.shows).checkVisibility()) wrong.push([first, second, "is not shown"]);
            if (!isKept && find(a.shows).checkVisibility()) wrong.push([first, "is still shown with", second]);
            open().forEach((name) => press(close[name]));
            if (open().length > 0) wrong.push([first, second, "left open", open()]);
        }}
    }}
    return wrong;
}}"""
OPEN = "Object.entries(dropanchor.panels()).flatMap(([name, is]) => is ? [name] : [])"


@pytest.fixture
def site() -> Iterator[ZonePlace]:
    with set_up_place() as place:
        yield place


def test_every_panel_opens_from_every_other_and_asks_only_when_something_typed_would_be_lost(
    chromium: Browser, site: ZonePlace
) -> None:
    with watched_page(chromium, site.url) as page:
        page.wait_for_map(1)
        expect(page.page.locator("#edit-plans")).to_be_visible()
        page.wait_for("dropanchor.events() && dropanchor.destinations().length === 1")
        assert set(page.page.evaluate("Object.keys(dropanchor.panels())")) == {
            *("tag", "start", "anchors", "plans", "zone", "destination", "rule", "measure"),
            *("past", "heat", "figures", "display", "sharing", "keys", "several", "trail"),
        }
        expect(page.page.locator("[data-part=new-rule] button")).to_have_count(4)
        assert page.page.evaluate(WALK) == []

        page.page.get_by_role("button", name="New: Tag lost").click()
        page.page.locator("#events summary").click()  # a list leaves a form that is in the lists
        assert page.page.evaluate(OPEN) == []

        page.page.locator("#alerts summary").click()
        page.page.get_by_role("button", name="New: Tag lost").click()
        form = page.page.get_by_role("form", name="Rule")
        form.get_by_label("Name").fill("Lost carts")
        question = page.page.locator("#confirm")
        for opener in ("#edit", "#edit-plans", "tr[data-tag='cart-3'] td.c-x", "#history", "#events summary"):
            page.page.locator(opener).click()
            expect(question).to_contain_text("What you typed is not saved")
            question.get_by_role("button", name="Cancel").click()
            expect(form.get_by_label("Name")).to_have_value("Lost carts")
        page.page.locator("#edit").click()
        question.get_by_role("button", name="Discard").click()
        expect(page.page.locator("#setup")).to_be_visible()
        assert page.page.evaluate(OPEN) == ["anchors"]
        page.page.locator("#history").click()  # the past cannot be set up
        assert page.page.evaluate(OPEN) == ["past"]
        page.page.locator("#options").click()
        page.page.locator("#show-keys").click()
        assert page.page.evaluate(OPEN) == ["past", "keys"]
        assert page.errors == []
