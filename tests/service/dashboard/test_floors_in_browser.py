"""The page has a choice of floors where plans show several, and tags of other floors are faint."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.plans import Floor
from dropanchor_service.estimation.columns import HeightSource
from service.dashboard.plan_place import PlanPlace, plan_place
from service.dashboard.test_plans_in_browser import edit, open_panel
from support.browser import watched_page
from support.plan_files import image_file

pytestmark = pytest.mark.browser

INK_3 = """() => {
    const probe = document.createElement("i");
    probe.style.color = "var(--ink-3)";
    document.body.append(probe);
    const { color } = getComputedStyle(probe);
    probe.remove();
    return color;
}"""
GROUND, UPPER = Floor(name="Ground", bottom_m=-1.0, top_m=3.0), Floor(name="Upper", bottom_m=3.0, top_m=6.0)


@pytest.fixture
def place() -> Iterator[PlanPlace]:
    with plan_place() as made:
        made.move("low", x=1.0, y=1.0, z=1.2, z_std=0.15)
        made.move("high", x=-1.0, y=1.0, z=4.5, z_std=0.15)
        made.move("unset", x=0.0, y=-1.0, z=0.0, z_std=0.15, z_source=HeightSource.START)
        made.put("ground", image_file(), floor=GROUND)
        yield made


def test_one_floor_needs_no_choice_and_a_second_one_brings_it_at_once(chromium: Browser, place: PlanPlace) -> None:
    with watched_page(chromium, place.url) as page:
        page.wait_for_map(3)
        page.wait_for("dropanchor.plans().length === 1")
        expect(page.page.locator("#floor")).to_be_hidden()
        place.put("upper", image_file(60, 20), floor=UPPER)
        choice = page.page.get_by_role("combobox", name="Floor", exact=True)
        expect(choice).to_have_value("Ground")
        assert choice.locator("option").all_text_contents() == ["Upper", "Ground"]
        assert page.errors == []


def test_a_chosen_floor_shows_its_plans_and_makes_the_tags_of_others_faint(chromium: Browser, place: PlanPlace) -> None:
    place.put("upper", image_file(60, 20), floor=UPPER)
    place.put("site", image_file(90, 20))
    with watched_page(chromium, place.url) as page:
        page.wait_for("dropanchor.tags().length === 3")
        page.wait_for("dropanchor.drawing().visible === 2 && dropanchor.drawing().elsewhere === 1")
        ready = "dropanchor.plans().filter(({ isReady }) => isReady).map(({ id }) => id).join()"
        page.wait_for(f"{ready} === 'ground,site'")
        page.page.get_by_role("combobox", name="Floor", exact=True).select_option("Upper")
        page.wait_for(f"{ready} === 'ground,upper,site'")
        low = page.page.get_by_role("gridcell", name="low, on another floor", exact=True)
        expect(low).to_have_css("color", page.page.evaluate(INK_3))
        page.page.locator("tr[data-tag='unset']").click()
        page.wait_for("dropanchor.drawing().visible === 2 && dropanchor.drawing().elsewhere === 1")
        page.page.reload()
        expect(page.page.get_by_role("combobox", name="Floor", exact=True)).to_have_value("Upper")
        place.move("low", x=1.0, y=1.0, z=4.0, z_std=0.15)
        page.wait_for("dropanchor.drawing().visible === 3 && dropanchor.drawing().elsewhere === 0")
        expect(low).to_have_count(0)
        place.move("low", x=1.0, y=1.0, z=4.0, z_std=1.0)  # on this floor with a probability of 0.8
        page.wait_for("dropanchor.drawing().visible === 2 && dropanchor.drawing().elsewhere === 1")
        assert page.errors == []


def test_a_plan_is_given_a_floor_and_needs_both_heights(chromium: Browser, place: PlanPlace) -> None:
    place.put("upper", image_file(60, 20))
    with watched_page(chromium, place.url) as page:
        form = edit(page, open_panel(page), "upper")
        form.get_by_label("Floor").fill("Upper")
        form.get_by_label("From height").fill("3")
        form.get_by_role("button", name="Save plan").click()
        expect(form.get_by_label("to height")).to_be_focused()
        form.get_by_label("to height").fill("2")
        form.get_by_role("button", name="Save plan").click()
        expect(form).to_be_visible()
        form.get_by_label("to height").fill("6")
        form.get_by_role("button", name="Save plan").click()
        expect(form).to_be_hidden()
        assert place.plans.all["upper"].floor == UPPER
        expect(page.page.get_by_role("combobox", name="Floor", exact=True)).to_be_visible()
        form = edit(page, page.page.get_by_role("region", name="Floor plans", exact=True), "upper · Upper")
        for label in ("Floor", "From height", "to height"):
            form.get_by_label(label, exact=False).fill("")
        form.get_by_role("button", name="Save plan").click()
        expect(form).to_be_hidden()
        assert place.plans.all["upper"].floor is None


def test_a_link_brings_its_floor_and_the_wall_shows_one_floor_after_another(
    chromium: Browser, place: PlanPlace
) -> None:
    place.put("upper", image_file(60, 20), floor=UPPER)
    with watched_page(chromium, f"{place.url}#floor=Upper") as page:
        choice = page.page.locator("#floor")
        expect(choice).to_have_value("Upper")
        choice.select_option("Ground")
        page.wait_for("location.hash.includes('floor=Ground')")
        page.page.evaluate("location.hash = '#floor=Upper'")
        expect(choice).to_have_value("Upper")
    with watched_page(chromium, f"{place.url}?kiosk=floors&every=2") as page:
        for floor in ("Upper", "Ground", "Upper"):
            expect(page.page.locator("#floor")).to_have_value(floor)
        expect(page.page.locator("#floor")).to_be_visible()
        assert page.errors == []
