"""Floor plans are uploaded, aligned, changed and deleted on the page, and every open page shows them at once."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from playwright.sync_api import Browser, FilePayload, Locator, expect
from pymap3d.enu import geodetic2enu

from dropanchor_schemas.plans import ControlPoint, Plan
from dropanchor_schemas.site import Anchor, Georeference, Site
from service.dashboard.plan_place import PlanPlace, plan_place
from support.browser import WatchedPage, watched_page
from support.plan_files import geotiff_file, image_file, pdf_file, svg_file
from support.zenoh_router import wait_until

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 400, 200


@pytest.fixture
def place() -> Iterator[PlanPlace]:
    with plan_place() as made:
        yield made


def file(name: str, media_type: str, content: bytes) -> FilePayload:
    return {"name": name, "mimeType": media_type, "buffer": content}


HALL = file("North hall.png", "image/png", image_file(WIDTH, HEIGHT))


def open_panel(page: WatchedPage) -> Locator:
    """Open the panel of the plans once the map stands still."""
    page.page.get_by_role("button", name="Set up floor plans").click()
    page.wait_for("dropanchor.anchors().length > 0 && dropanchor.drawing().still")
    return page.page.get_by_role("region", name="Floor plans", exact=True)


def add(panel: Locator, *files: FilePayload) -> Locator:
    """Upload a plan, and return the form with its settings."""
    panel.get_by_label("File").set_input_files(list(files))
    panel.get_by_role("button", name="Add plan").click()
    form = panel.get_by_role("form", name="Floor plan", exact=True)
    expect(form).to_be_visible()
    return form


def edit(page: WatchedPage, panel: Locator, name: str) -> Locator:
    """Open a plan in the list, and return the form with its settings once the page has read them."""
    with page.page.expect_response(lambda response: "/api/v1/plans/" in response.url):
        panel.get_by_role("button", name=name).click()
    return panel.get_by_role("form", name="Floor plan", exact=True)


def click_pixel(page: WatchedPage, column_px: float, row_px: float) -> None:
    """Click where the map shows a pixel of the edited plan."""
    corners = page.page.evaluate("dropanchor.draft().corners")
    (x0, y0), (x1, y1), _, (x3, y3) = corners
    across, down = column_px / WIDTH, row_px / HEIGHT
    x, y = x0 + across * (x1 - x0) + down * (x3 - x0), y0 + across * (y1 - y0) + down * (y3 - y0)
    page.page.locator("#map").click(position={"x": x, "y": y})


def place_of(plan: Plan, column_px: float, row_px: float) -> complex:
    """Return where a pixel lies in the site."""
    placement = plan.placement
    turn = complex(math.cos(placement.rotation_rad), math.sin(placement.rotation_rad)) * placement.m_per_px
    pixel = complex(column_px - plan.image.width_px / 2, plan.image.height_px / 2 - row_px)
    return complex(placement.x, placement.y) + turn * pixel


def residuals_of(points: Sequence[tuple[float, float, float, float]]) -> list[float]:
    """Return the residuals of the best similarity, found by an independent solver of linear equations."""
    rows = [row for column, down, _, _ in points for row in ([column, down, 1, 0], [-down, column, 0, 1])]
    places = np.array([value for _, _, x, y in points for value in (x, y)], float)
    found = np.linalg.lstsq(np.array(rows, float), places, rcond=None)[0]
    off: list[float] = np.hypot(*(np.array(rows) @ found - places).reshape(-1, 2).T).tolist()
    return off


def test_a_plan_is_uploaded_and_aligned_by_two_points_in_every_open_page(chromium: Browser, place: PlanPlace) -> None:
    with watched_page(chromium, place.url) as page, watched_page(chromium, place.url) as other:
        form = add(open_panel(page), HALL)
        expect(form.get_by_label("Name")).to_have_value("North hall")
        other.wait_for("dropanchor.plans().length === 1 && dropanchor.plans()[0].isReady")
        form.get_by_role("button", name="Add point").click()
        page.page.locator("#map").click(position={"x": 10, "y": 10})
        expect(form.get_by_role("status").get_by_text("That was beside the plan.")).to_be_visible()
        click_pixel(page, 40, 20)
        expect(form.get_by_text("Now say where this place is")).to_be_visible()
        form.get_by_label("Point 1 is at anchor").select_option("17")
        expect(form.get_by_label("Point 1: x in m")).to_have_value("0")
        expect(form.locator("li small")).to_have_text([""])
        form.get_by_role("button", name="Add point").click()
        click_pixel(page, 360, 20)
        form.get_by_label("Point 2: x in m").fill("0")
        form.get_by_label("Point 2: y in m").fill("16")
        form.get_by_role("button", name="Save plan").click()
        expect(page.page.locator("#outcome")).to_contain_text("Plan North hall changed.")
        plan = place.plans.all["north-hall"]
        assert abs(place_of(plan, 40, 20)) < 0.2  # a click is exact to a pixel of the screen
        assert abs(place_of(plan, 360, 20) - 16j) < 0.2
        assert plan.placement.rotation_rad == pytest.approx(math.pi / 2, abs=0.02)
        assert [(point.x, point.y) for point in plan.control_points] == [(0.0, 0.0), (0.0, 16.0)]
        other.wait_for(f"dropanchor.plans()[0].placement.x === {plan.placement.x}")
        page.page.locator("#outcome").get_by_role("button", name="Undo").click()
        wait_until(lambda: place.plans.all["north-hall"].control_points == [])
        other.wait_for("dropanchor.plans()[0].placement.rotation_rad === 0")
        page.page.get_by_role("button", name="North hall").click()
        form.get_by_role("button", name="Cancel").click()
        form = add(page.page.get_by_role("region", name="Floor plans", exact=True), HALL)
        expect(form.get_by_label("Name")).to_have_value("North hall 2")
        assert page.errors == other.errors == []


def test_the_distance_between_two_points_scales_a_plan_and_one_place_moves_it(
    chromium: Browser, place: PlanPlace
) -> None:
    with watched_page(chromium, place.url) as page:
        form = add(open_panel(page), HALL)
        form.get_by_role("button", name="Add point").click()
        click_pixel(page, 100, 100)
        form.get_by_label("Point 1: x in m").fill("3")
        form.get_by_label("Point 1: y in m").fill("-2")
        form.get_by_role("button", name="Add point").click()
        click_pixel(page, 300, 100)
        form.get_by_label("Distance between points 1 and 2").fill("20")
        form.get_by_role("button", name="Save plan").click()
        expect(form).to_be_hidden()
        plan = place.plans.all["north-hall"]
        assert plan.placement.m_per_px == pytest.approx(0.1, rel=0.02)
        assert plan.placement.rotation_rad == 0.0
        assert abs(place_of(plan, 100, 100) - (3 - 2j)) < 0.3


def test_a_plan_is_aligned_moved_and_changed_by_hand_and_deleted(chromium: Browser, place: PlanPlace) -> None:
    points = [(0, 0, -10, 5), (400, 0, 10, 5), (400, 200, 10, -5.6)]
    place.put("measured", image_file(WIDTH, HEIGHT), control_points=[
        ControlPoint(column_px=column, row_px=row, x=x, y=y) for column, row, x, y in points
    ])  # fmt: skip
    place.put("hall", image_file(WIDTH, HEIGHT))
    mine = place.put("shared", image_file(WIDTH, HEIGHT))
    with watched_page(chromium, place.url) as page:
        panel, outcome = open_panel(page), page.page.locator("#outcome")
        form = edit(page, panel, "measured")
        expect(form.get_by_text("at most 0.60 m off")).to_be_visible()
        form.get_by_label("Point 3: y in m").fill("-5.3")
        off = residuals_of([*points[:2], (400, 200, 10, -5.3)])
        expect(form.get_by_text(f"at most {max(off):.2f} m off")).to_be_visible()
        expect(form.locator("li small")).to_have_text([f"{one:.2f} m off" for one in off])
        form.get_by_role("button", name="Remove point 3").click()
        expect(form.get_by_text("at most")).to_be_hidden()
        form.get_by_role("button", name="Save plan").click()
        expect(form).to_be_hidden()

        edit(page, panel, "hall")
        form.get_by_role("button", name="Move by hand").click()
        page.page.locator("#map").focus()
        page.page.keyboard.press("Shift+ArrowRight")
        page.page.keyboard.press("ArrowUp")
        expect(form.get_by_label("x of its centre")).to_have_value("1")
        before = page.page.evaluate("dropanchor.draft().corners[0]")
        box = page.page.locator("#map").bounding_box()
        assert box is not None
        page.page.mouse.move(box["x"] + before[0] + 40, box["y"] + before[1] + 40)
        page.page.mouse.down()
        page.page.mouse.move(box["x"] + before[0] + 70, box["y"] + before[1] + 20)
        page.page.mouse.up()
        after = page.page.evaluate("dropanchor.draft().corners[0]")
        assert (after[0] - before[0], after[1] - before[1]) == pytest.approx((30, -20), abs=1)
        form.get_by_label("Turned").fill("90")
        form.get_by_label("Width").fill("40")
        form.get_by_label("x of its centre").fill("7")
        form.get_by_label("Opacity").fill("0.3")
        form.get_by_role("button", name="Save plan").click()
        expect(form).to_be_hidden()
        plan = place.plans.all["hall"]
        assert (plan.placement.x, plan.opacity) == (7.0, 0.3)
        assert plan.placement.m_per_px == pytest.approx(0.1)
        assert plan.placement.rotation_rad == pytest.approx(math.pi / 2)

        edit(page, panel, "shared")
        form.get_by_label("Name").fill("Mine")
        page.page.route("**/api/v1/plans", lambda route: route.abort())  # the list has the older one until it is saved
        place.plans.put("shared", mine.model_copy(update={"name": "Theirs"}))
        form.get_by_role("button", name="Save plan").click()
        expect(outcome).to_contain_text("Somebody else changed this meanwhile")
        assert place.plans.all["shared"].name == "Theirs"
        page.page.unroute("**/api/v1/plans")
        outcome.get_by_role("button", name="Take the newer one").click()
        expect(form.get_by_label("Name")).to_have_value("Theirs")
        form.get_by_role("button", name="Save plan").click()
        expect(form).to_be_hidden()

        plan = place.plans.all["shared"]
        edit(page, panel, "Theirs")
        form.get_by_role("button", name="Move by hand").click()
        x = page.page.evaluate("dropanchor.draft().placement.x")
        for _ in range(2):
            page.page.locator("#map").press("Shift+ArrowRight")
        page.wait_for(f"dropanchor.draft().placement.x === {x} + 2")
        expect(outcome).to_contain_text("Plan moved. Not saved yet.")
        page.page.keyboard.press("Control+z")
        page.wait_for(f"dropanchor.draft().placement.x === {x}")
        form.get_by_role("button", name="Delete…").click()
        page.page.get_by_role("dialog").get_by_role("button", name="Delete").click()
        expect(outcome).to_contain_text("Plan Theirs deleted.")
        page.wait_for("dropanchor.plans().length === 2")
        page.page.keyboard.press("Control+z")
        wait_until(lambda: place.plans.all.get("shared") == plan)
        page.wait_for("dropanchor.plans().length === 3")
        assert [error for error in page.errors if "412" not in error and "ERR_FAILED" not in error] == []


def test_the_map_shows_the_pixels_of_the_plan_in_light_and_inverted_in_dark(
    chromium: Browser, place: PlanPlace
) -> None:
    place.put("hall", image_file(WIDTH, HEIGHT), opacity=1.0)
    with watched_page(chromium, place.url) as page:
        edit(page, open_panel(page), "hall")
        page.wait_for("dropanchor.plans()[0].isReady && dropanchor.drawing().still")
        (x0, y0), (x1, _), *_ = page.page.evaluate("dropanchor.draft().corners")

        def colours() -> list[tuple[int, ...]]:
            return [page.pixel(x0 + share * (x1 - x0), y0 + 9)[:3] for share in (0.26, 0.74)]

        wait_until(lambda: colours() == [(255, 0, 0), (0, 0, 255)])
        page.page.locator("#theme").click()
        page.wait_for("dropanchor.drawing().still")

        def is_inverted() -> bool:
            page.page.wait_for_timeout(50)
            return colours() == [(0, 255, 255), (255, 255, 0)]

        wait_until(is_inverted)


def test_what_did_not_arrive_at_first_is_requested_again(chromium: Browser, place: PlanPlace) -> None:
    with watched_page(chromium, place.url) as page:
        page.page.route("**/plan-images/*", lambda route: route.abort(), times=1)
        place.put("hall", image_file(WIDTH, HEIGHT))
        page.wait_for("dropanchor.plans().length === 1")
        page.wait_for("dropanchor.plans()[0].isReady")
        page.page.route("**/api/v1/access", lambda route: route.abort(), times=2)
        page.page.reload()
        expect(page.page.get_by_role("button", name="Set up floor plans")).to_be_visible()


def test_a_file_that_is_refused_says_why_and_every_other_kind_is_shown(chromium: Browser, place: PlanPlace) -> None:
    shown: list[tuple[FilePayload, tuple[int, int]]] = [
        (file("a.svg", "image/svg+xml", svg_file('<rect width="100" height="50" fill="red"/>')), (4096, 2048)),
        (file("b.jpg", "image/jpeg", image_file(WIDTH, HEIGHT, "JPEG")), (WIDTH, HEIGHT)),
        (file("c.tif", "image/tiff", image_file(WIDTH, HEIGHT, "TIFF")), (WIDTH, HEIGHT)),
    ]
    with watched_page(chromium, place.url) as page:
        panel = open_panel(page)
        for content, words in (
            (svg_file("<use href='other.svg#a'/>"), "other.svg"),
            (image_file(), "said to be image/svg+xml"),
        ):
            panel.get_by_label("File").set_input_files(file("a.svg", "image/svg+xml", content))
            panel.get_by_role("button", name="Add plan").click()
            expect(panel.get_by_role("alert")).to_contain_text(words)
        assert place.plans.all == {}
        for uploaded, size in shown:
            form = add(panel, uploaded)
            image = place.plans.all[uploaded["name"][0]].image
            assert (image.width_px, image.height_px) == size
            page.wait_for(f"dropanchor.plans().filter(({{ isReady }}) => isReady).length === {len(place.plans.all)}")
            panel.get_by_role("button", name="Add plan…").click()
            expect(form).to_be_hidden()  # or the next one would seem to be there already
        expect(panel.get_by_label("Page")).to_be_hidden()
        panel.get_by_label("File").set_input_files(file("hall.pdf", "application/pdf", pdf_file((72, 72), (144, 72))))
        panel.get_by_label("Page").fill("2")
        panel.get_by_role("button", name="Add plan").click()
        expect(form).to_be_visible()
        assert place.plans.all["hall"].image.width_px == 400
        assert all("422" in error for error in page.errors)


def test_a_georeferenced_image_lies_right_at_once(chromium: Browser) -> None:
    site = Site(anchors=[Anchor(id="17")], georeference=Georeference(lat=52.5, lon=13.4))
    geotiff = file("aerial.tif", "image/tiff", geotiff_file(WIDTH, HEIGHT, (391_400.0, 5_818_000.0), 0.1))
    world = file("hall.pgw", "", b"0.05\n0\n0\n-0.05\n1.025\n8.975\n")
    with plan_place(site) as place, watched_page(chromium, place.url) as page:
        panel = open_panel(page)
        form = add(panel, geotiff)
        assert place.plans.all["aerial"].placement.m_per_px == pytest.approx(0.1, rel=1e-3)
        form.get_by_role("button", name="Cancel").click()
        panel.get_by_label("File").set_input_files([file("hall.png", "image/png", image_file(WIDTH, HEIGHT)), world])
        panel.get_by_label("Coordinate system").fill("site")
        panel.get_by_role("button", name="Add plan").click()
        expect(form).to_be_visible()
        placement = place.plans.all["hall"].placement
        assert (placement.x, placement.y, placement.m_per_px) == pytest.approx((11.0, 4.0, 0.05))


def test_a_point_is_placed_by_latitude_and_longitude(chromium: Browser) -> None:
    origin = Georeference(lat=52.5, lon=13.4, rotation_rad=0.4)
    with plan_place(Site(anchors=[Anchor(id="17")], georeference=origin)) as place:
        place.put("hall", image_file(WIDTH, HEIGHT))
        with watched_page(chromium, place.url) as page:
            form = edit(page, open_panel(page), "hall")
            form.get_by_role("button", name="Add point").click()
            click_pixel(page, 100, 100)
            form.get_by_label("Point 1: latitude, longitude").fill("52.5021, 13.3982")
            form.get_by_role("button", name="Save plan").click()
            expect(form).to_be_hidden()
        (point,) = place.plans.all["hall"].control_points
        east, north, _ = geodetic2enu(52.5021, 13.3982, 0.0, origin.lat, origin.lon, 0.0)
        there = complex(east, north) * complex(math.cos(-0.4), math.sin(-0.4))
        assert abs(complex(point.x, point.y) - there) < 0.01
