"""The settings of a tag on the page, its start, and its deletion."""

import math
import re

import pytest
from playwright.sync_api import Browser, Locator, Response, Route, expect

from dropanchor_schemas.site import TagSettings
from dropanchor_service.estimation.columns import State, StateReason
from service.dashboard.place import Place
from support.browser import WatchedPage, watched_page
from support.zenoh_router import wait_until

pytestmark = pytest.mark.browser


def open_settings(page: WatchedPage, tag: str) -> Locator:
    """Open the settings of a tag, and return their form once it is filled."""
    page.page.locator(f"tr[data-tag='{tag}']").click()
    with page.page.expect_response(lambda response: f"/{tag}/settings" in response.url):
        page.page.locator("#detail .settings > summary").click()
    form = page.page.get_by_role("form", name="Settings of the tag")
    expect(setting(form, "height_m")).to_have_attribute("data-shown", re.compile(r"^.*$"))
    return form


def setting(form: Locator, name: str) -> Locator:
    return form.locator(f"[name={name}]")


def test_a_name_a_colour_and_a_group_show_on_the_list_and_the_map_of_every_page(
    chromium: Browser, place: Place
) -> None:
    place.move("cart", "van", x=[1.0, 3.0], y=1.0, heading=math.nan)
    with (
        watched_page(chromium, place.url) as page,
        watched_page(chromium, place.url) as other,
    ):
        form = open_settings(page, "cart")
        form.get_by_label("Name").fill("Forklift 1")
        form.get_by_label("Group").fill("forklifts")
        form.get_by_label("Colour").select_option(label="Orange")
        form.get_by_role("button", name="Save settings").click()
        expect(page.page.locator("#outcome")).to_contain_text("Settings of cart changed.")
        given = place.bench.answers.site.tag_settings("cart")
        assert given == TagSettings(name="Forklift 1", colour="#d97a0a", group="forklifts")
        expect(other.page.locator("tr[data-tag='cart'] .name")).to_have_text("Forklift 1")
        other.wait_for_map(2)
        x, y = other.tags()["cart"]["pixel"]
        assert other.pixel(x, y - 8.5)[:3] == pytest.approx((0xD9, 0x7A, 0x0A), abs=40)
        other.page.get_by_label("Group to show").select_option("forklifts")
        expect(other.page.locator("#count")).to_have_text("1 of 2 tags")
        other.wait_for("dropanchor.drawing().visible === 1")
        other.page.get_by_role("button", name="Show all", exact=True).click()
        other.page.get_by_label("Filter tags by name").fill("fork")
        expect(other.page.locator("#count")).to_have_text("1 of 2 tags")
        assert page.errors == other.errors == []


def test_settings_are_saved_undone_and_merged_with_those_of_another_page(chromium: Browser, place: Place) -> None:
    place.move("cart", x=1.0, y=1.0)
    store = place.bench.answers.site
    with watched_page(chromium, place.url) as page:
        form = open_settings(page, "cart")
        expect(setting(form, "group")).to_have_attribute("list", "groups")
        check_all_settings(form)
        form.get_by_label("Moved by").select_option("A person on foot")
        setting(form, "mount_angle_rad").fill("90")
        setting(form, "height_m").fill("1.2")
        form.get_by_role("button", name="Save settings").click()
        outcome = page.page.locator("#outcome")
        expect(outcome).to_contain_text("Settings of cart changed.")
        carried = TagSettings(motion="carried", mount_angle_rad=math.pi / 2, height_m=1.2)
        assert store.tag_settings("cart") == carried
        outcome.get_by_role("button", name="Undo").click()
        expect(outcome).to_contain_text("Undone")
        assert store.tag_settings("cart") == TagSettings()
        expect(setting(form, "height_m")).to_have_value("0")

        form.get_by_text("All other settings").click()
        form.get_by_label("Height is told").select_option("Yes")
        setting(form, "range_std_m").fill("0.2")
        form.get_by_label("Moves backwards").select_option("Yes")
        setting(form, "mount_angle_std_rad").fill("2")
        with page.page.expect_response(is_read):
            form.get_by_role("button", name="Save settings").click()
        told = TagSettings(height_told=True, range_std_m=0.2, reverse_allowed=True, mount_angle_std_rad=math.radians(2))
        assert store.tag_settings("cart") == told
        expect(form.locator("#setting-range_std_m")).to_contain_text("Default: not set. In force: set here.")
        setting(form, "range_std_m").fill("")
        with page.page.expect_response(is_read):
            form.get_by_role("button", name="Save settings").click()
        assert store.tag_settings("cart") == told.model_copy(update={"range_std_m": None})

        setting(form, "range_scale").fill("0")
        form.get_by_role("button", name="Save settings").click()
        expect(form.locator("#setting-range_scale").get_by_role("alert")).to_have_text(re.compile("greater than 0"))
        expect(setting(form, "range_scale")).to_have_value("0")
        setting(form, "range_scale").fill("1")
        expect(form.get_by_role("alert")).to_have_count(0)
        store.set_tag("cart", TagSettings())
        page.page.reload()
        form = open_settings(page, "cart")
        form.get_by_label("Name").fill("Mine")
        store.set_tag("cart", TagSettings(name="Theirs", height_m=2.0))
        form.get_by_role("button", name="Save settings").click()
        outcome.get_by_role("button", name="Keep mine").click()
        wait_until(lambda: store.tag_settings("cart") == TagSettings(name="Mine", height_m=2.0))


def check_all_settings(form: Locator) -> None:
    """The form has every setting but the start, and says what each is, its unit, its default and where it is from."""
    names = form.evaluate("form => [...form.elements].map(({ name }) => name).filter((name) => name)")
    assert sorted([*names, "start"]) == sorted(TagSettings.model_fields)
    for name in names:
        box = form.locator(f"#setting-{name}")
        expect(box).to_contain_text(re.compile(r"\. ?Default: .+\. In force: default\."))
    expect(form.locator("#setting-mount_angle_rad")).to_contain_text("Mounting angle ° Direction of travel minus")
    expect(form.locator("#setting-lever_left_m")).to_contain_text("Default: 0 m.")
    expect(form.locator("#setting-speed_max_mps")).to_contain_text("Top speed m/s Top speed of the tag; not set")


def is_read(answer: Response) -> bool:
    """Return whether the page has read the settings of a tag."""
    return answer.request.method == "GET" and answer.url.endswith("/settings")


def test_what_another_page_saved_while_the_same_was_typed_here_is_not_overwritten_unasked(
    chromium: Browser, place: Place
) -> None:
    place.move("cart", x=1.0, y=1.0)
    store, held = place.bench.answers.site, list[Route]()

    def hold(route: Route) -> None:
        held.append(route) if route.request.method == "GET" else route.continue_()

    with watched_page(chromium, place.url) as page:
        form = open_settings(page, "cart")
        page.page.route("**/settings", hold, times=2)  # a change, and the reading that follows it
        form.get_by_label("Group").fill("vans")
        with page.page.expect_request(lambda request: request.method == "GET" and request.url.endswith("/settings")):
            form.get_by_role("button", name="Save settings").click()
        form.get_by_label("Name").fill("Mine")
        store.set_tag("cart", TagSettings(name="Theirs", group="vans"))
        held[0].continue_()
        form.get_by_role("button", name="Save settings").click()
        page.page.locator("#outcome").get_by_role("button", name="Keep mine").click()
        wait_until(lambda: store.tag_settings("cart") == TagSettings(name="Mine", group="vans"))


@pytest.mark.parametrize(("height", "told"), [("2", TagSettings(height_m=2.0)), ("", TagSettings())])
def test_what_is_typed_while_a_change_is_saved_stays_and_is_saved_after_it(
    chromium: Browser, place: Place, height: str, told: TagSettings
) -> None:
    place.move("cart", x=1.0, y=1.0)
    store, held = place.bench.answers.site, list[Route]()
    with watched_page(chromium, place.url) as page:
        form = open_settings(page, "cart")
        save = form.get_by_role("button", name="Save settings")
        page.page.route("**/settings", lambda route: held.append(route), times=1)
        setting(form, "height_m").fill("0")
        with page.page.expect_request("**/settings"):
            save.click()
        form.get_by_label("Name").fill("Forklift 1")
        setting(form, "height_m").fill(height)
        save.click()
        held[0].continue_()
        expect(form.get_by_label("Name")).to_have_attribute("data-shown", "Forklift 1")
        assert store.tag_settings("cart") == told.model_copy(update={"name": "Forklift 1"})
        assert page.errors == []


def test_the_tag_is_here_sets_its_start_by_a_drag_or_by_numbers(chromium: Browser, place: Place) -> None:
    place.move("cart", x=1.0, y=1.0, heading=0.0)
    with watched_page(chromium, place.url) as page:
        page.wait_for_map(1)
        open_settings(page, "cart")
        page.page.get_by_role("button", name="The tag is here…").click()
        form = page.page.get_by_role("form", name="Where the tag is")
        expect(form.get_by_label("Heading")).to_have_value("90")
        page.wait_for("dropanchor.drawing().still")
        box = page.page.locator("#map").bounding_box()
        assert box is not None
        x, y = (
            corner + pixel for corner, pixel in zip((box["x"], box["y"]), page.tags()["cart"]["pixel"], strict=True)
        )
        page.page.mouse.move(x + 40, y)
        page.page.mouse.down()
        page.page.mouse.move(x + 40, y + 60)
        page.page.mouse.up()
        expect(form.get_by_label("Heading")).to_have_value("180")
        form.get_by_role("button", name="Set start").click()
        expect(page.page.locator("#outcome")).to_contain_text("Start of cart set.")
        start = place.bench.answers.site.tag_settings("cart").start
        assert start is not None
        assert [start.y, start.heading_rad] == pytest.approx([1.0, -math.pi / 2], abs=0.03)
        assert start.x > 1.2
        expect(form).to_be_hidden()
        place.move("cart", x=1.0, y=1.0, state=State.LOST, reason=StateReason.RANGES_MISSING)  # it came of that
        expect(page.page.locator("#detail [data-part='hint']")).to_contain_text(re.compile("^You said .* ago where"))
        page.page.get_by_role("button", name="The tag is here…").click()
        form.get_by_label("x").fill("2")
        form.get_by_label("Heading").fill("")
        form.get_by_label("Heading").press("Enter")
        wait_until(lambda: place.bench.answers.site.tag_settings("cart").start != start)
        typed = place.bench.answers.site.tag_settings("cart").start
        assert typed is not None
        assert (typed.x, typed.heading_rad) == (2.0, None)
        assert page.errors == []


def test_a_deleted_tag_leaves_every_page(chromium: Browser, place: Place) -> None:
    place.move("cart", "van", x=[1.0, 3.0], y=1.0)
    with watched_page(chromium, place.url) as page, watched_page(chromium, place.url) as other:
        other.page.locator("tr[data-tag='cart']").wait_for()
        open_settings(page, "cart").get_by_role("button", name="Delete tag…").click()
        page.page.get_by_role("dialog").get_by_role("button", name="Delete").click()
        for one in (page, other):
            expect(one.page.locator("tr[data-tag='cart']:not([hidden])")).to_have_count(0)
            expect(one.page.locator("#count")).to_have_text("1 tag")
        assert page.errors == other.errors == []
