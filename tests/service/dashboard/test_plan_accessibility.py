"""The accessibility checker axe-core finds no violation where floor plans are set up and shown."""

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.plans import ControlPoint, Floor
from dropanchor_schemas.site import TagSettings
from service.dashboard.plan_place import PlanPlace, plan_place
from service.dashboard.test_plans_in_browser import edit, file, open_panel
from support.axe import violations
from support.browser import WatchedPage, watched_page
from support.plan_files import svg_file

pytestmark = pytest.mark.browser

HALL = svg_file(
    '<rect width="800" height="500" fill="white"/><g fill="none" stroke="black" stroke-width="6">'
    '<path d="M5 5h790v490h-790zM300 5v180m0 80v230M300 300h220m80 0h195M560 5v180M560 185h120"/></g>'
    '<g font-family="sans-serif" font-size="34"><text x="70" y="240">Store</text><text x="360" y="420">Assembly</text>'
    '<text x="620" y="100">Office</text></g>',
    'width="800" height="500"',
)
M_PER_PX = 20 / 4096
POINTS = [(41, 41, -9.7, 5.7), (4055, 41, 9.8, 5.9), (4055, 2519, 9.9, -5.8)]


def hall(place: PlanPlace) -> None:
    """Put two floors, and tags on both."""
    for tag, height_m, x, y in (("forklift-1", 1.2, 2.0, -3.0), ("crane", 4.5, -3.0, 1.0), ("cart", 0.0, 5.0, 2.0)):
        place.bench.answers.site.set_tag(tag, TagSettings(height_m=height_m))
        place.move(tag, x=x, y=y, z=height_m, z_std=0.15)
    points = [ControlPoint(column_px=column, row_px=row, x=x, y=y) for column, row, x, y in POINTS]
    ground = Floor(name="Ground floor", bottom_m=-1.0, top_m=3.0)
    place.put("hall", HALL, M_PER_PX, ground, name="North hall", control_points=points)
    place.put("upper", svg_file(), M_PER_PX, Floor(name="Upper floor", bottom_m=3.0, top_m=6.0))


def test_no_violation_while_plans_are_shown_uploaded_and_aligned(chromium: Browser, axe: str) -> None:
    with plan_place() as place:
        hall(place)
        with watched_page(chromium, place.url) as page:

            def check(view: str) -> None:
                assert violations(page.page, axe) == [], view

            page.wait_for("dropanchor.plans()[0]?.isReady && dropanchor.drawing().elsewhere === 1")
            page.wait_for("dropanchor.drawing().still")
            check("shown")
            _refuse(page)
            check("refused")
            page.page.get_by_role("region", name="Floor plans", exact=True).get_by_role("button", name="Close").click()
            form = edit(page, open_panel(page), "North hall")
            expect(form.get_by_text("m off at these points")).to_be_visible()
            form.get_by_role("button", name="Add point").click()
            check("aligned")


def _refuse(page: WatchedPage) -> None:
    panel = open_panel(page)
    panel.get_by_label("File").set_input_files(file("a.svg", "image/svg+xml", svg_file('<use href="other.svg#a"/>')))
    panel.get_by_role("button", name="Add plan").click()
    expect(panel.get_by_role("alert")).to_contain_text("other.svg")
