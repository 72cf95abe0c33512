"""The details of a tag show its floor and a side view of its height, in the present and in the past."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, expect

from dropanchor_schemas.plans import Floor
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.estimation.columns import HeightSource
from dropanchor_service.plans.floors import follow_floors
from dropanchor_service.plans.store import PlanStore
from service.dashboard.past_place import RETENTION, SECOND, iso
from service.dashboard.place import live_api_bench
from service.dashboard.plan_place import PlanPlace
from support.browser import WatchedPage, watched_page
from support.http_server import running_server
from support.plan_files import image_file

pytestmark = pytest.mark.browser
RIDE_S = 40


@pytest.fixture
def house(tmp_path: Path) -> Iterator[tuple[PlanPlace, int]]:
    """A house of two floors with a tag in a lift that has come to the upper one, and the end of its ride, ns."""
    bench, plans = live_api_bench(folder=tmp_path, retention=RETENTION), PlanStore(None)
    follow_floors(plans, bench.answers.site)
    end_ns = time.time_ns() // SECOND * SECOND
    with running_server(bench.app(DASHBOARD, plans=plans), bench.stopping) as port:
        place = PlanPlace(bench, f"http://127.0.0.1:{port}/", plans)
        place.put("ground", image_file(), floor=Floor(name="Ground", bottom_m=0.0, top_m=3.0))
        place.put("upper", image_file(60, 20), floor=Floor(name="Upper", bottom_m=3.0, top_m=6.0))
        for second in range(RIDE_S + 1):
            z = min(4.2, 1.2 + 0.15 * max(0, second - 10))
            height = {"z": z, "z_std": 0.2, "z_source": HeightSource.PRESSURE}
            place.move("lift", x=1.0, t_ns=end_ns - (RIDE_S - second) * SECOND, **height)
        place.move("cart", x=-1.0, z=1.2, z_std=0.15)
        bench.write_history()
        yield place, end_ns


def side_view(page: WatchedPage) -> Locator:
    return page.page.get_by_role("img", name="Height over time, from 1.20 m to 4.20 m", exact=True)


def test_the_details_of_a_tag_in_a_lift_show_its_floor_and_a_side_view(
    chromium: Browser, house: tuple[PlanPlace, int]
) -> None:
    place, _ = house
    with watched_page(chromium, place.url) as page:
        page.page.locator("tr[data-tag='lift']:not([hidden])").click()
        expect(page.page.locator("[data-part='v-floor']")).to_have_text("Upper, 100 %")
        expect(side_view(page)).to_be_visible()
        expect(side_view(page).locator("text.name")).to_have_text(["Upper"])  # its bottom is in view
        page.page.locator("tr[data-tag='cart']").click()
        expect(page.page.locator("[data-part='v-floor']")).to_have_text("Ground, 100 %")
        expect(page.page.locator("[data-part='heights']")).to_be_hidden()  # its height does not change
        assert page.errors == []


def test_the_past_shows_the_floor_of_that_time_and_the_heights_of_the_period(
    chromium: Browser, house: tuple[PlanPlace, int]
) -> None:
    place, end_ns = house
    begin_ns = end_ns - RIDE_S * SECOND
    link = f"{place.url}#from={iso(begin_ns)}&to={iso(end_ns)}&at={iso(begin_ns + 5 * SECOND)}&floor=Ground"
    with watched_page(chromium, link) as page:
        page.wait_for("dropanchor.past() && !dropanchor.past().loading && dropanchor.tags().length === 1")
        page.page.locator("tr[data-tag='lift']:not([hidden])").click()
        expect(page.page.locator("[data-part='v-floor']")).to_have_text("Ground, 100 %")
        expect(page.page.locator("[data-part='v-height']")).to_contain_text("1.20 m ± 0.20 m")
        expect(side_view(page)).to_be_visible()
        page.page.get_by_role("combobox", name="Floor", exact=True).select_option("Upper")
        page.wait_for("dropanchor.drawing().elsewhere === 1")
        assert page.errors == []
