"""The measurements of a selected tag are shown beside the expected ones, on the map and in small plots."""

import math
import re
import time
from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.site import Anchor, Site
from dropanchor_schemas.wire import Reason
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.estimation.columns import HYPOTHESIS, INNOVATION, POSE, Array, State, StateReason
from dropanchor_service.store.norths import North
from service.dashboard.place import Place, live_api_bench
from support.browser import Scheme, WatchedPage, watched_page
from support.http_server import running_server

pytestmark = pytest.mark.browser

COUNT, STEP_S, SPEED = 60, 0.1, 1.0
REFUSED = (20, 21)
HEADING_SIGMA = 0.2


@pytest.fixture
def place() -> Iterator[Place]:
    bench = live_api_bench(Site(anchors=[Anchor(id="17"), Anchor(id="18", x=20.0)]))
    with running_server(bench.app(DASHBOARD), bench.stopping) as port:
        yield Place(bench, f"http://127.0.0.1:{port}/")


def drive(place: Place, tag: str = "cart", hard_gate: bool = False, parts: Sequence[float] = (0.0,) * 6) -> Array:
    """Make a tag come straight from the east at 1 m/s, with ranges to both anchors in turn. Return its INNOVATION."""
    row = place.bench.answers.tags.register(tag).row
    end_ns = time.time_ns()
    poses, innovations = np.zeros(COUNT, POSE), np.zeros(COUNT, INNOVATION)
    for i in range(COUNT):
        age_s = (COUNT - 1 - i) * STEP_S
        x = 5.0 + SPEED * age_s
        poses[i]["t_ns"] = innovations[i]["t_ns"] = end_ns - round(age_s * 1e9)
        poses[i]["x"], poses[i]["y"], poses[i]["heading"], poses[i]["speed"] = x, 0.0, math.pi, SPEED
        innovations[i]["anchor"] = i % 2
        innovations[i]["predicted"] = x if i % 2 == 0 else 20.0 - x
        innovations[i]["innovation"] = 0.9 if i in REFUSED else 0.05 * (-1) ** (i // 2)
    poses["row"] = innovations["row"] = row
    poses["state"], poses["reason"], poses["p_mode"] = State.TRACKING, StateReason.RESOLVED, 1.0
    poses["cov"], poses["sigma_pos"] = np.diag([0.04, 0.01, HEADING_SIGMA**2]), 0.22
    poses["parts"] = parts
    innovations["measured"] = np.add(innovations["predicted"], innovations["innovation"])
    innovations["S"] = 0.1**2
    innovations["fused"] = [i not in REFUSED for i in range(COUNT)]
    innovations["white_std"], innovations["lasting_std"] = (np.nan, np.nan) if hard_gate else (0.3, 0.4)
    innovations["p_outlier"] = np.nan if hard_gate else ~innovations["fused"]
    poses["anchor"], poses["range"] = innovations["anchor"], innovations["measured"]
    for i in range(COUNT):
        place.bench.answers.latest.write(poses[i : i + 1], np.empty(0, HYPOTHESIS), innovations[i : i + 1])
    return innovations


def select(page: WatchedPage, tag: str = "cart") -> None:
    page.page.locator(f"tr[data-tag='{tag}']").click()
    page.page.locator("[data-part='plots']").wait_for(state="visible")


def marks(page: WatchedPage, plot: str, name: str) -> list[tuple[float, float]]:
    """Return the positions of the marks of a path in pixels of the plot."""
    d = page.page.locator(f"[data-plot='{plot}'] path.{name}").first.get_attribute("d") or ""
    return [(float(x), float(y)) for x, y in re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", d)]


def test_what_is_known_of_the_samples_of_a_tag_is_shown_where_it_belongs(chromium: Browser, place: Place) -> None:
    innovations = drive(place)
    tags = place.bench.answers.tags
    row = tags.register("cart").row
    tags.rows.count_samples("range", np.full(1204, row))
    tags.rows.count_samples("imu", np.full(12040, row))
    tags.rows.count_rejected(Reason.LATE, np.full(3, row))
    tags.rows.count_rejected(Reason.RANGE_ABSURD, np.full(1, row))
    with watched_page(chromium, place.url) as page:
        select(page)
        legend = page.page.locator(".legend").filter(has=page.page.locator("i.measured"))
        legend.scroll_into_view_if_needed()
        around = legend.bounding_box()
        for mark in legend.locator("i").all():
            box = mark.bounding_box()
            assert around
            assert box
            assert around["x"] <= box["x"] < around["x"] + around["width"]
            assert around["y"] <= box["y"] < around["y"] + around["height"]

        used = innovations[innovations["fused"]]
        seconds = (used["t_ns"] - innovations["t_ns"][-1]) * 1e-9
        for plot, values in (("range", used["measured"]), ("innovation", used["innovation"] / 0.1)):
            x, y = np.array(marks(page, plot, "measured")).T
            assert len(x) == len(used) == COUNT - len(REFUSED)
            assert np.corrcoef(x, seconds)[0, 1] > 0.9999
            assert np.corrcoef(y, values)[0, 1] < -0.999
            assert len(marks(page, plot, "refused")) == len(REFUSED)
        expect(page.page.locator("[data-text='innovation']")).to_have_text("97 % in the band, 2 of 60 refused")
        assert page.page.locator("[data-plot='range'] path.expected").count() == 2

        text = page.page.locator("[data-text='speed']").inner_text()
        rate = re.fullmatch(r"1\.00 m/s, its range changes by (.*) m/s", text)
        assert rate is not None
        assert float(rate[1]) == pytest.approx(SPEED, abs=0.1)
        estimate = marks(page, "speed", "estimate")
        minimum = marks(page, "speed", "least")
        assert len(estimate) >= 5
        half = len(minimum) // 2  # the upper edge; the lower one lies on zero
        assert np.median([y for _, y in minimum[:half]]) == pytest.approx(estimate[0][1], abs=6.0)
        assert {y for _, y in minimum[half:]} == {max(y for _, y in minimum)}

        used, refused = (page.page.locator(f"[data-part='{part}'] li") for part in ("samples", "rejected"))
        expect(used).to_have_text(["Used", "imu 12,040", "range 1,204"])
        expect(refused).to_have_text(["Not used", "late 3", "range absurd 1"])
        assert page.page.locator("[data-part='uncertainty']").is_hidden()  # the engine tells no parts
        assert page.errors == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_map_shows_the_uncertainty_of_the_heading(chromium: Browser, place: Place, scheme: Scheme) -> None:
    with watched_page(chromium, place.url, scheme) as page:
        drive(place)
        page.wait_for_map(1)
        empty = sector(page, 0.0), sector(page, 2.5 * HEADING_SIGMA)
        select(page)
        while sector(page, 0.0) == empty[0]:
            page.page.wait_for_timeout(50)
        assert sector(page, 2.5 * HEADING_SIGMA) == empty[1]


def sector(page: WatchedPage, off_rad: float) -> tuple[int, ...]:
    """Return the colour of the map 40 pixels from the dot, at an angle off its heading, which is west."""
    x, y = page.tags()["cart"]["pixel"]
    return page.pixel(x - 40 * math.cos(off_rad), y - 40 * math.sin(off_rad) - 2)


def test_the_innovations_of_an_engine_with_a_hard_gate_are_shown_too(chromium: Browser, place: Place) -> None:
    with watched_page(chromium, place.url) as page:
        drive(place, hard_gate=True)
        select(page)
        assert len(marks(page, "range", "refused")) == len(REFUSED)
        assert page.errors == []


def test_the_page_says_how_much_ranges_scatter_where_the_engine_learns_it(chromium: Browser, place: Place) -> None:
    with watched_page(chromium, place.url) as page:
        drive(place)
        drive(place, "van", hard_gate=True)
        select(page)
        scatter = page.page.locator("[data-text='scatter']")
        expect(scatter).to_have_text("Its ranges scatter by 0.50 m, of which 0.40 m last for seconds")
        select(page, "van")
        expect(scatter).to_have_text("")


def test_a_tag_without_innovations_has_no_plots(chromium: Browser, place: Place) -> None:
    place.move("cart", x=2.0, y=1.0)
    with watched_page(chromium, place.url) as page:
        with page.page.expect_response(lambda response: "/explain" in response.url):
            page.page.locator("tr[data-tag='cart']").click()
        with page.page.expect_response(lambda response: "/explain" in response.url):
            page.wait_for("document.querySelector('[data-part=\"v-x\"]').textContent === '2.00 m'")
        assert page.page.locator("[data-part='plots']").is_hidden()
        assert page.errors == []


def test_the_panel_can_be_focused_and_scrolled_with_the_keyboard(chromium: Browser, place: Place) -> None:
    drive(place)
    with watched_page(chromium, place.url, size=(1280, 600)) as page:
        select(page)
        page.page.locator("#detail").focus()
        page.page.keyboard.press("End")
        page.wait_for("document.getElementById('detail').scrollTop > 50")
        label = page.page.locator("[data-plot='range'] svg").get_attribute("aria-label")
        assert label == "Ranges: 60, of which 2 refused"


def test_the_panel_names_what_the_ellipse_comes_from_and_what_would_shrink_it(chromium: Browser, place: Place) -> None:
    with watched_page(chromium, place.url) as page:
        drive(place, parts=(0.2, 0.05, 0.0, 0.07, 0.04, 0.0))
        select(page)
        box = page.page.locator("[data-part='uncertainty']")
        box.wait_for()
        expect(box.locator("p")).to_have_text(
            "± 0.5 m, of which 0.4 m come from where north is. Set where it starts and looks (`start`)."
        )
        names = [line.split("\n")[0] for line in box.locator("li").all_inner_texts()]
        assert names == ["North", "Start", "Mounting", "Ranges"]
        assert page.errors == []


def test_north_that_others_know_is_applied_with_one_click_and_may_be_undone(chromium: Browser, place: Place) -> None:
    tags, site = place.bench.answers.tags, place.bench.answers.site
    for name in ("a", "b"):
        tags.rows.norths.set(tags.register(name).row, North(-2.4, 0.1))
    with watched_page(chromium, place.url) as watched:
        drive(place, parts=(0.2, 0.05, 0.0, 0.07, 0.04, 0.0))
        tags.rows.count_samples("imu", np.array([tags.register("cart").row]))
        for name in ("a", "b"):  # else their rows appear where the next one is clicked
            watched.page.locator(f"tr[data-tag='{name}']").wait_for()
        select(watched)
        box = watched.page.locator("[data-part='uncertainty']")
        expect(box.locator("p")).to_contain_text(
            "2 tags of this site that know where they started say that north is 138°"
        )
        box.get_by_role("button", name="Apply to all tags").click()
        expect(watched.page.locator("#outcome")).to_contain_text("North of the site turned by 138°.")
        assert site.site.declination_rad == pytest.approx(-2.4)
        assert site.site.declination_std_rad == pytest.approx(0.12, abs=0.01)
        expect(box.get_by_role("button", name="Apply to all tags")).to_be_hidden()
        watched.page.keyboard.press("Control+z")
        expect(watched.page.locator("#outcome")).to_contain_text("Undone")
        assert site.site.declination_rad == 0.0
        assert watched.errors == []
