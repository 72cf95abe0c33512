"""The list, the details and the map share the room of the page, and what a person gives to each is remembered."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Locator, expect

from dropanchor_schemas.plans import Placement, Plan
from dropanchor_service.plans.reading.messages import Request
from dropanchor_service.plans.reading.read_plan import read_plan
from dropanchor_service.plans.store import PlanStore
from service.dashboard.panel_place import set_up_place
from service.dashboard.zone_place import ZonePlace
from support.axe import violations
from support.browser import WatchedPage, watched_page
from support.plan_files import image_file

pytestmark = pytest.mark.browser

COMPLETE = "dropanchor.zones().yard >= 0 && dropanchor.destinations()[0] && dropanchor.plans()[0]?.isReady"
ROWS = """() => {
    const box = document.getElementById("table").getBoundingClientRect();
    return [...document.querySelectorAll("#table tbody tr:not([hidden])")]
        .map((row) => row.getBoundingClientRect())
        .filter(({ top, bottom }) => top >= box.top && bottom <= box.bottom + 1).length;
}"""
IS_UNCOVERED = """(element) => {
    const { left, right, top, bottom } = element.getBoundingClientRect();
    const inside = [[left + 3, top + 3], [right - 3, bottom - 3]].map(([x, y]) => document.elementFromPoint(x, y));
    return inside.every((found) => found && (element.contains(found) || found === element));
}"""
TARGETS = "button, summary, select, tbody tr, input:not([type=checkbox], [type=range])"
SMALL_TARGETS = f"""() => [...document.querySelectorAll("{TARGETS}")]
    .filter((one) => one.checkVisibility() && one.getBoundingClientRect().height < 43.5)
    .map((one) => one.outerHTML)"""
SHARE_OF_TOOLS = """() => {
    const [tools, map] = ["tools", "map"].map((id) => document.getElementById(id).getBoundingClientRect());
    return (tools.width * tools.height) / (map.width * map.height);
}"""


def with_a_plan() -> PlanStore:
    plans = PlanStore(None)
    image = plans.add_image(read_plan(image_file(200, 100), Request(media_type="image/png")))
    plans.put("hall", Plan(id="hall", image=image, placement=Placement(x=0, y=0, m_per_px=0.05)))
    return plans


@pytest.fixture
def site() -> Iterator[ZonePlace]:
    with set_up_place(with_a_plan()) as place:
        place.move(*(f"forklift-{number}" for number in range(5)), x=[-3.0, -1.0, 0.0, 1.0, 3.0], y=1.0)
        yield place


def height(part: Locator) -> float:
    box = part.bounding_box()
    assert box is not None
    return box["height"]


def settled_height(page: WatchedPage, part: Locator) -> float:
    """Return the height once it stays: the details grow when the explanation of the tag has come."""
    seen = [height(part)]
    while len(seen) < 4 or len(set(seen[-4:])) > 1:
        page.page.wait_for_timeout(600)  # explanations are asked for twice a second, and may take a while
        seen.append(height(part))
    return seen[-1]


def width(part: Locator) -> float:
    box = part.bounding_box()
    assert box is not None
    return box["width"]


def assert_no_violation(page: WatchedPage, axe: str) -> None:
    """Check every look, and show the page in its own size again."""
    size = page.page.viewport_size
    assert size is not None
    assert violations(page.page, axe) == []
    page.page.set_viewport_size(size)


def drag(page: WatchedPage, bar: Locator, up_px: float) -> None:
    box = bar.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x, y - up_px, steps=3)
    page.page.mouse.up()


def test_six_rows_and_the_buttons_that_save_stay_in_view_and_the_bars_remember_where_they_are(
    chromium: Browser, site: ZonePlace
) -> None:
    with watched_page(chromium, site.url, size=(1440, 900)) as page:
        page.wait_for_map(6)
        tag, detail = page.page.locator("tr[data-tag='cart-3']"), page.page.locator("#detail")
        tag.click()
        expect(detail).to_be_visible()
        assert page.page.evaluate(ROWS) == 6
        here = page.page.get_by_role("button", name="The tag is here…")
        assert here.evaluate(IS_UNCOVERED)
        assert here.evaluate("here => here.compareDocumentPosition(document.querySelector('.plots')) & 4")

        before = settled_height(page, detail)
        bar = page.page.get_by_role("separator", name="Height of the details")
        drag(page, bar, -120)
        dragged = height(detail)
        assert dragged == pytest.approx(before - 120, abs=12)
        bar.press("ArrowDown")
        assert height(detail) < dragged - 20
        page.page.get_by_role("separator", name="Width of the list").press("ArrowLeft")
        aside = page.page.locator("aside")
        kept = [height(detail), width(aside)]
        assert kept[1] > 1440 * 0.43
        page.wait_for("location.hash.includes('tag=cart-3')")  # it is written twice a second at most
        page.page.reload()
        page.wait_for("window.dropanchor?.status() === 'live'")
        expect(detail).to_be_visible()
        assert [height(detail), width(aside)] == pytest.approx(kept, abs=2)
        bar.dblclick()
        page.wait_for("document.body.style.getPropertyValue('--details') === ''")
        assert height(detail) > kept[0] + 60  # as the style sheet and its content say

        page.page.locator("#alerts summary").click()
        for wide, tall in ((1440, 900), (1024, 768)):
            page.page.set_viewport_size({"width": wide, "height": tall})
            page.page.locator("#edit-plans").click()
            page.page.get_by_role("button", name="hall").click()
            assert page.page.evaluate(ROWS) >= 4
            assert page.page.get_by_role("button", name="Save plan").evaluate(IS_UNCOVERED)
            page.page.get_by_role("button", name="New e-mail").click()
            assert page.page.get_by_role("button", name="Save destination").evaluate(IS_UNCOVERED)
            page.page.get_by_role("form", name="Destination").get_by_role("button", name="Cancel").click()


def test_on_a_phone_the_list_comes_first_in_a_sheet_and_one_button_stands_for_the_tools(
    chromium: Browser, site: ZonePlace, axe: str
) -> None:
    with watched_page(chromium, site.url, size=(390, 844)) as page:
        page.wait_for_map(6)
        page.wait_for(COMPLETE)
        aside, sheet = page.page.locator("aside"), page.page.get_by_role("separator", name="Height of the list")
        assert page.page.evaluate(ROWS) >= 4
        parts = ["map", "filter", "table", "events"]
        tops = [page.page.locator(f"#{part}").evaluate("part => part.getBoundingClientRect().top") for part in parts]
        assert tops == sorted(tops)
        assert page.page.evaluate(SHARE_OF_TOOLS) < 0.05
        assert page.page.evaluate(SMALL_TARGETS) == []

        page.page.get_by_role("button", name="Tools").click()
        expect(page.page.get_by_role("button", name="Zoom in")).to_be_visible()
        assert page.page.evaluate(SMALL_TARGETS) == []
        assert_no_violation(page, axe)
        page.page.get_by_role("button", name="Measure").click()
        expect(page.page.get_by_role("button", name="Zoom in")).to_be_hidden()
        expect(page.page.locator("#measured")).to_be_visible()

        before = height(aside)
        page.page.get_by_role("button", name="Pull the list up").click()
        assert height(aside) > 1.4 * before
        page.page.reload()
        page.wait_for(COMPLETE)
        assert height(aside) > 1.4 * before
        page.page.get_by_role("button", name="Put the list down").click()
        assert height(aside) == pytest.approx(before, abs=2)
        drag(page, sheet, 150)
        assert height(aside) == pytest.approx(before + 150, abs=12)
        sheet.press("ArrowDown")
        assert height(aside) < before + 130

        page.page.locator("tr[data-tag='cart-3']").click()
        expect(page.page.get_by_role("button", name="The tag is here…")).to_be_visible()
        expect(page.page.locator("#table")).to_be_hidden()
        page.page.locator("#detail .settings > summary").click()
        assert page.page.get_by_role("button", name="Save settings").evaluate(IS_UNCOVERED)
        assert page.page.evaluate(SMALL_TARGETS) == []
        page.page.locator("#detail [data-part='close']").click()
        expect(page.page.locator("#table")).to_be_visible()
        assert page.errors == []
