"""Zones are drawn, edited and deleted on the map, with pointer and keyboard."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Locator, Route, expect

from dropanchor_schemas.zones import Circle, Polygon
from service.dashboard.zone_place import ZonePlace, disc, served, square, zone_place
from support.browser import WatchedPage, drag, watched_page

pytestmark = pytest.mark.browser


@pytest.fixture
def yard() -> Iterator[ZonePlace]:
    place = zone_place()
    place.put(square("yard", 1.0, 1.0, name="Yard"), disc("dock", -3.0, 0.0, 1.5, name="Dock"))
    place.go("cart-3", -4.0, -4.0)
    with served(place):
        yield place


def open_list(page: WatchedPage) -> Locator:
    page.wait_for("dropanchor.events() && 'yard' in dropanchor.zones()")
    page.wait_for_map(1)
    page.page.locator("#zone-list summary").click()
    return page.page.get_by_role("form", name="Zone", exact=True)


def points_of(place: ZonePlace, zone: str) -> list[list[float]]:
    shape = place.zones[zone].shape
    assert isinstance(shape, Polygon)
    return shape.points


def test_zones_are_drawn_and_edited_with_pointer_and_keyboard(chromium: Browser, yard: ZonePlace) -> None:
    with watched_page(chromium, yard.url) as page:
        form = open_list(page)
        page.page.get_by_role("button", name="New polygon").click()
        canvas = page.page.locator("#map")
        for x, y in ((200, 300), (320, 300), (320, 400), (200, 400)):
            canvas.click(position={"x": x, "y": y})
        page.page.get_by_role("button", name="Corner 1 of 4").click()
        expect(page.page.get_by_role("button", name="New corner after")).to_have_count(4)
        form.get_by_label("Name").fill("Gate 7")
        form.get_by_label("Too long after").fill("300")
        form.get_by_label("Event on leaving").uncheck()
        form.get_by_label("From height").fill("3")
        form.get_by_label("to height").fill("6.5")
        form.get_by_label("Tags").fill("cart-3, cart-4")
        form.get_by_label("Groups").fill("Carts of hall 2, forklifts")
        form.get_by_label("Delay").fill("0")
        form.get_by_role("button", name="Save zone").click()
        expect(form).to_be_hidden()
        made = yard.zones["gate-7"]
        assert (made.name, made.dwell_s, made.enter, made.exit) == ("Gate 7", 300.0, True, False)
        assert (made.z_min_m, made.z_max_m) == (3.0, 6.5)
        assert made.tags == ["cart-3", "cart-4"]
        assert made.groups == ["Carts of hall 2", "forklifts"]
        (x0, y0), (x1, _), (_, y2), _ = points_of(yard, "gate-7")
        assert (x1 - x0) / (y0 - y2) == pytest.approx(1.2, rel=0.02)
        yard.go("cart-3", (x0 + x1) / 2, (y0 + y2) / 2, z=4.0, z_std=0.1)
        expect(page.page.locator("#events summary")).to_contain_text("cart-3 entered Gate 7")

        page.page.get_by_role("button", name="Edit Yard").click()
        expect(form.get_by_label("Name")).to_be_focused()
        drag(page.page, page.page.get_by_role("button", name="Corner 1 of 4"), -40, 20)
        drag(page.page, page.page.get_by_role("button", name="New corner after 4"), -30, 0)
        page.page.get_by_role("button", name="Corner 3 of 5").press("Delete")
        form.get_by_role("button", name="Save zone").click()
        expect(form).to_be_hidden()
        first, _, third, fourth = points_of(yard, "yard")
        assert first[0] < 0.9
        assert first[1] < 0.9
        assert third == [1.0, 5.0]
        assert fourth[0] < 0.9
        assert yard.zones["yard"].name == "Yard"

        page.page.get_by_role("button", name="New polygon").press("Enter")
        expect(form.get_by_label("Name")).to_be_focused()
        page.page.keyboard.type("Keys")
        for _ in range(3):
            form.get_by_role("button", name="Add corner").press("Enter")
        corner = page.page.get_by_role("button", name="Corner 3 of 3")
        expect(corner).to_be_focused()
        before = corner.get_attribute("aria-label")
        page.page.keyboard.press("Shift+ArrowLeft")
        page.page.keyboard.press("ArrowUp")
        expect(corner).not_to_have_attribute("aria-label", before or "")
        form.get_by_label("Name").press("Enter")
        expect(form).to_be_hidden()
        assert len(points_of(yard, "keys")) == 3

        page.page.get_by_role("button", name="New circle").click()
        page.page.locator("#map").click(position={"x": 300, "y": 500})
        drag(page.page, page.page.get_by_role("button", name="Radius"), 30, 0)
        form.get_by_label("Name").fill("Pit")
        form.get_by_role("button", name="Save zone").click()
        expect(form).to_be_hidden()
        drawn = yard.zones["pit"].shape
        assert isinstance(drawn, Circle)
        page.page.get_by_role("button", name="Edit Pit").click()
        form.get_by_label("Radius").fill("2.5")
        form.get_by_role("button", name="Save zone").click()
        expect(form).to_be_hidden()
        assert yard.zones["pit"].shape == drawn.model_copy(update={"radius_m": 2.5})
        assert page.errors == []


def test_a_polygon_that_crosses_itself_is_refused_in_words_at_its_place(chromium: Browser, yard: ZonePlace) -> None:
    with watched_page(chromium, yard.url) as page:
        form = open_list(page)
        page.page.get_by_role("button", name="New polygon").click()
        for x, y in ((200, 300), (320, 400), (320, 300), (200, 400)):
            page.page.locator("#map").click(position={"x": x, "y": y})
        form.get_by_role("button", name="Save zone").click()
        expect(form.get_by_role("alert")).to_contain_text("The edges cross or touch each other near")
        box = page.page.locator("#handles .mark").bounding_box()
        canvas = page.page.locator("#map").bounding_box()
        assert box is not None
        assert canvas is not None
        assert box["x"] + 12 - canvas["x"] == pytest.approx(260, abs=4)
        assert box["y"] + 12 - canvas["y"] == pytest.approx(350, abs=4)
        assert set(yard.zones) == {"yard", "dock"}


def test_what_others_changed_meanwhile_is_not_overwritten_and_a_deletion_asks(
    chromium: Browser, yard: ZonePlace
) -> None:
    with watched_page(chromium, yard.url) as page:
        form = open_list(page)
        page.page.get_by_role("button", name="Edit Yard").click()
        expect(form.get_by_label("Name")).to_be_focused()
        yard.put(square("yard", 2.0, 2.0, name="Theirs"))
        form.get_by_label("Name").fill("Mine")
        form.get_by_role("button", name="Save zone").click()
        expect(form.get_by_role("alert")).to_contain_text("Somebody else changed this meanwhile")
        assert yard.zones["yard"].name == "Theirs"
        form.get_by_role("button", name="Take the newer one").click()
        expect(form.get_by_label("Name")).to_have_value("Theirs")
        form.get_by_label("Name").fill("Ours")
        form.get_by_role("button", name="Save zone").click()
        expect(form).to_be_hidden()
        assert (yard.zones["yard"].name, points_of(yard, "yard")[0]) == ("Ours", [2.0, 2.0])

        page.page.get_by_role("button", name="New circle").click()
        page.page.locator("#map").click(position={"x": 300, "y": 300})
        form.get_by_label("Name").fill("Gate")
        page.page.route("**/zones", lambda route: route.abort())  # the page cannot know the other zone
        yard.put(disc("gate", 5.0, 5.0, 1.0, name="Theirs"))
        form.get_by_role("button", name="Save zone").click()
        expect(form.get_by_role("alert")).to_contain_text("Somebody else changed this meanwhile")
        page.page.unroute("**/zones")
        form.get_by_role("button", name="Save zone").click()
        expect(form).to_be_hidden()
        assert (yard.zones["gate"].name, yard.zones["gate-2"].name) == ("Theirs", "Gate")

        page.page.get_by_role("button", name="Edit Ours").click()
        form.get_by_role("button", name="Delete…").click()
        expect(form.get_by_role("button", name="Delete zone")).to_be_focused()
        form.get_by_role("button", name="Keep it").click()
        assert "yard" in yard.zones
        form.get_by_role("button", name="Delete…").click()
        form.get_by_role("button", name="Delete zone").click()
        expect(form).to_be_hidden()
        assert set(yard.zones) == {"dock", "gate", "gate-2"}
        expect(page.page.locator("#zone-list li")).to_have_count(3)

        held: list[Route] = []
        page.page.route(
            "**/zones/dock", lambda route: held.append(route) if route.request.method == "PUT" else route.continue_()
        )
        page.page.get_by_role("button", name="Edit Dock").click()
        form.get_by_label("Name").fill("Depot")
        with page.page.expect_request(lambda request: request.method == "PUT"):
            form.get_by_role("button", name="Save zone").click()
        page.page.locator("#edit").click()
        expect(form).to_be_visible()
        expect(page.page.locator("#confirm")).to_be_hidden()
        held[0].continue_()
        expect(page.page.locator("#setup")).to_be_visible()
        expect(form).to_be_hidden()
        assert yard.zones["dock"].name == "Depot"
