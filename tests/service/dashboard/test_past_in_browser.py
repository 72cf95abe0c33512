"""The page shows the past: a period of stored tracks, at any time and speed, and never as the present."""

import math
import re
import time
from datetime import datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import pyarrow.parquet as pq
import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_service.api.app import DASHBOARD
from service.dashboard.past_place import MINUTES, RETENTION, SECOND, iso, link_to, wait_for_past, write_past
from service.dashboard.place import Place, live_api_bench
from support.axe import violations
from support.browser import every_look, watched_page
from support.http_server import running_server

pytestmark = pytest.mark.browser

TOKYO = ZoneInfo("Asia/Tokyo")


def test_a_link_leads_to_a_moment_of_the_past_and_back_to_the_present(
    chromium: Browser, past: tuple[Place, int]
) -> None:
    place, end_ns = past
    with watched_page(chromium, link_to(place, end_ns, 30.5, tag="first")) as page:
        wait_for_past(page, 3)
        tags = page.tags()
        assert tags["first"]["x"] == pytest.approx(30.5, abs=0.01)
        assert tags["turned"]["state"] == "relative"
        assert math.isnan(tags["turned"]["x"])  # it is no place of the map
        assert tags["first"]["semiMajor"] == pytest.approx(0.2 * 2.4477, rel=1e-2)
        expect(page.page.locator("[data-part='v-accuracy']")).to_have_text("± 0.49 m along, ± 0.24 m across")
        expect(page.page.locator("[data-part='v-anchor']")).to_be_hidden()  # not stored
        expect(page.page.locator("#status-text")).to_have_text("Past")
        expect(page.page.locator(".past .note")).to_contain_text("not the present")
        expect(page.page).to_have_title("Past · Dropanchor")
        expect(page.page.locator("[data-part='v-online']")).to_have_text("–")
        place.move("first", x=-4.0)  # the present goes on, but the past does not show it
        page.page.wait_for_timeout(600)
        assert page.tags()["first"]["x"] == pytest.approx(30.5, abs=0.01)
        page.page.goto(link_to(place, end_ns, 155, tag="second"))
        lane = page.page.locator("#lane")
        expect(lane).to_contain_text(re.compile(r"Tracked 9\d %, at no known place \d %"))
        expect(lane).to_contain_text("0 stops of a minute or more")
        expect(lane.locator("path[data-state='lost']")).to_have_count(1)
        marked = page.page.locator("tr[data-tag='second'] .c-tag")
        expect(marked).to_have_attribute("style", re.compile("--mark: *#"))  # the row is drawn after the lane
        mark = marked.evaluate("one => one.style.getPropertyValue('--mark')")
        colour = f"rgb({', '.join(str(int(mark[at : at + 2], 16)) for at in (1, 3, 5))})"
        expect(lane.locator("path.estimate").first).to_have_css("stroke", colour)
        page.page.goto(link_to(place, end_ns, 155, tag="first"))
        page.wait_for("dropanchor.tags()[0]?.x > 150")
        assert {tag: known["state"] for tag, known in page.tags().items()} == {
            "first": "tracking",
            "second": "ambiguous",
            "turned": "relative",
        }
        page.page.locator("#filter").fill("zone:ramp")
        expect(page.page.locator("#count")).to_have_text("1 of 3 tags")  # of the shown moment, not of the present
        expect(page.page.locator("tr[data-tag='first']")).to_be_visible()
        page.page.get_by_role("button", name="Show all", exact=True).click()
        page.page.locator("#events summary").click()
        event = page.page.locator("#events li")
        expect(event).to_have_text(re.compile("entered Dock"))  # and no other: not the one after the period
        marks = page.page.locator(".past path[data-part='events']").get_attribute("d") or ""
        assert marks.startswith(f"M{round(1000 * (60 * MINUTES - 100) / (60 * MINUTES))} ")
        event.get_by_role("button").click()
        page.wait_for(f"Math.abs(dropanchor.tags()[0]?.x - {60 * MINUTES - 110}) < 0.01")  # ten seconds before
        page.page.goto(link_to(place, end_ns - 3600 * SECOND, 155))
        expect(page.page.locator("#events summary")).to_contain_text("none found")
        page.page.locator("[data-part='leave']").click()
        page.wait_for("dropanchor.past() === false && dropanchor.tags()[0].x === -4")
        expect(page.page.locator("#status-text")).to_have_text("Live")
        page.wait_for("!location.hash.includes('from=')")
        assert page.errors == []


def test_the_keyboard_plays_and_moves_the_clock_and_the_map_follows(chromium: Browser, past: tuple[Place, int]) -> None:
    place, end_ns = past
    with watched_page(chromium, link_to(place, end_ns, 0, speed="50", tag="first")) as page:
        wait_for_past(page, 3)
        asked = "performance.getEntriesByType('resource').some(({ name }) => /max_points=5000&tags=first/.test(name))"
        page.wait_for(asked)  # for the line of the chosen tag
        page.page.locator("[data-part='follow']").click()
        slider = page.page.locator("[data-part='slider']")
        slider.focus()
        page.page.keyboard.press("ArrowRight")
        page.page.keyboard.press("ArrowRight")
        page.wait_for("dropanchor.tags()[0].x === 2")
        assert re.search(r"\d\d:\d\d:\d\d", slider.get_attribute("aria-valuetext") or "")
        page.page.keyboard.press(" ")
        page.wait_for("dropanchor.past().playing")
        page.wait_for("dropanchor.tags()[0].x > 20")
        page.page.keyboard.press(" ")
        page.wait_for("!dropanchor.past().playing")
        stopped = page.tags()["first"]["x"]
        page.page.wait_for_timeout(400)
        assert page.tags()["first"]["x"] == stopped
        page.page.keyboard.press(" ")
        page.wait_for("!dropanchor.past().playing && dropanchor.tags()[0].x === 300")  # it stops at the end
        page.wait_for(f"location.hash.includes('at={iso(end_ns)}')")
        page.wait_for("dropanchor.drawing().still")
        box = page.page.locator("#map").bounding_box()
        assert box is not None
        assert page.tags()["first"]["pixel"] == pytest.approx([box["width"] / 2, box["height"] / 2], abs=3)
        assert page.errors == []


def test_figures_and_the_file_of_a_tag(chromium: Browser, past: tuple[Place, int]) -> None:
    place, end_ns = past
    with watched_page(chromium, link_to(place, end_ns, 10, tag="first")) as page:
        wait_for_past(page, 3)
        figures = page.page.locator("#past-figures")
        expect(figures.locator("[data-part='distance']")).to_have_text("300 m")
        expect(figures.locator("[data-part='tracked']")).to_have_text("5 min")
        expect(figures.locator("[data-part='mean']")).to_have_text("1.00 m/s")
        expect(figures.locator("[data-format='gpx']")).to_be_disabled()
        expect(figures.locator("[data-part='no-georeference']")).to_be_visible()
        with page.page.expect_download() as download:
            figures.locator("[data-format='csv']").click()
        assert download.value.suggested_filename == "first.csv"
        assert len(download.value.path().read_text().splitlines()) == 60 * MINUTES + 2
        with page.page.expect_download() as download:
            figures.locator("[data-format='parquet']").click()
        assert pq.read_metadata(download.value.path()).num_rows == 60 * MINUTES + 1
        page.page.locator("[data-part='figures']").click()
        table, dialog = page.page.locator("#figures table"), page.page.locator("#figures")
        expect(table.locator("thead")).to_have_text("TagTrackedDistanceMean speedMaximum speedIn dock (deleted)")
        expect(table.locator("tbody tr")).to_have_text(
            [
                "first0:05:00300.0 m1.00 m/s1.00 m/s0:03:20",
                re.compile("^second0:04:4"),
                re.compile("^turned0:00:000.0 m–"),
            ]
        )
        table.locator("th button").nth(2).click()
        expect(table.locator("[aria-sort]")).to_have_text("Distance")
        with page.page.expect_download() as download:
            dialog.locator("[data-part='save']").click()
        assert download.value.path().read_text().splitlines()[1].startswith("first,")
        dialog.locator("[data-part='close']").click()
        assert page.errors == []


def test_a_georeferenced_site_gives_gpx_kml_and_geojson(chromium: Browser, tmp_path: Path) -> None:
    site = Site(anchors=[Anchor(id="17")], georeference=Georeference(lat=52.0, lon=13.0))
    bench = live_api_bench(site, tmp_path, RETENTION)
    end_ns = time.time_ns() // SECOND * SECOND - 3600 * SECOND
    with running_server(bench.app(DASHBOARD), bench.stopping) as port:
        place = Place(bench, f"http://127.0.0.1:{port}/")
        write_past(place, end_ns, minutes=1)
        with watched_page(chromium, link_to(place, end_ns, 299, tag="first")) as page:
            wait_for_past(page, 3)
            for form, mark in (("gpx", "<trkpt"), ("kml", "<when>"), ("geojson", '"Feature"')):
                with page.page.expect_download() as download:
                    page.page.locator(f"[data-format='{form}']").click()
                text = download.value.path().read_text()
                assert text.count(mark) == 61


def test_a_period_is_chosen_and_a_wrong_or_an_empty_one_is_explained(
    chromium: Browser, past: tuple[Place, int]
) -> None:
    place, end_ns = past
    with watched_page(chromium, place.url) as page:
        page.wait_for_map(2)  # "turned" was lost an hour ago, nobody knows where
        page.page.locator("#options").click()
        expect(page.page.locator("#zone-said")).to_contain_text("the time zone of this browser")
        page.page.get_by_label("Time zone of the site").select_option("Asia/Tokyo")
        expect(page.page.locator("#zone-said")).to_have_text("Times are in Asia/Tokyo, the time zone of the site.")
        assert place.bench.answers.site.site.time_zone == "Asia/Tokyo"
        page.page.keyboard.press("Escape")
        page.page.locator("#history").click()
        wait_for_past(page, 3)
        assert page.tags()["first"]["x"] == pytest.approx(
            0, abs=0.1
        )  # the past begins with its first pose, not an hour before the last one
        expect(page.page.locator(".past [data-part='time']")).to_contain_text("GMT+9")
        begin = datetime.fromtimestamp(end_ns / SECOND - 60 * MINUTES, TOKYO).replace(tzinfo=None)
        shown = datetime.fromisoformat(page.page.locator("[data-part='from']").input_value())
        assert 0 <= (begin - shown).total_seconds() <= 20
        page.page.locator("[data-part='to']").fill("2020-01-02T00:00:00")
        page.page.locator("[data-part='from']").fill("2020-01-01T00:00:00")
        page.page.locator("[data-part='show']").click()
        wait_for_past(page, 0)
        problem = page.page.locator(".past [data-part='problem']")
        expect(problem).to_have_text(re.compile("No poses are stored in this period. All poses are from .* to "))
        local = [
            datetime.fromtimestamp(t / SECOND, TOKYO).strftime("%Y-%m-%dT%H:%M:%S")
            for t in (end_ns - 60 * SECOND, end_ns)
        ]
        page.page.locator("[data-part='from']").fill(local[1])
        page.page.locator("[data-part='to']").fill(local[0])
        page.page.locator("[data-part='show']").click()
        expect(problem).to_contain_text("end must come after the start")
        page.page.locator("[data-part='from']").fill(local[0])
        page.page.locator("[data-part='to']").fill(local[1])
        page.page.locator("[data-part='show']").click()
        wait_for_past(page, 3)
        expect(problem).to_have_text("")
        assert page.errors == []


def test_the_slider_shows_where_poses_are_and_a_day_is_chosen_at_once(chromium: Browser, tmp_path: Path) -> None:
    bench = live_api_bench(folder=tmp_path, retention=RETENTION)
    noon = datetime.now().replace(hour=12, minute=0, second=0, microsecond=0) - timedelta(days=1)
    noon_ns = round(noon.timestamp()) * SECOND
    with running_server(bench.app(DASHBOARD), bench.stopping) as port:
        place = Place(bench, f"http://127.0.0.1:{port}/")
        with watched_page(chromium, place.url) as page:
            page.page.locator("#history").click()
            expect(page.page.locator(".past [data-part='problem']")).to_contain_text("Nothing is stored yet")
            for end_ns in (noon_ns, noon_ns + 3600 * SECOND):
                write_past(place, end_ns, minutes=1)
            page.page.get_by_role("button", name="Yesterday").click()
            wait_for_past(page, 3)
            page.wait_for(
                "document.querySelectorAll('[data-part=stored]')[0].getAttribute('d')?.split('M').length === 3"
            )
            assert page.page.evaluate("dropanchor.past().time_ms") == noon_ns / 1e6 - 60_000
            gap = page.page.locator(".past [data-part='gap']")
            expect(gap).to_have_text("")
            address = (
                f"from={iso(noon_ns - 60 * SECOND)}&to={iso(noon_ns + 3600 * SECOND)}&at={iso(noon_ns + 1800 * SECOND)}"
            )
            page.page.goto(f"{place.url}#{address}")
            expect(gap).to_contain_text("No poses from")
            page.page.locator("[data-part='day']").fill(f"{noon:%Y-%m-%d}")
            page.wait_for(f"dropanchor.past().time_ms === {noon_ns / 1e6 - 60_000:.0f}")
            expect(page.page.locator("[data-part='to']")).to_have_value(f"{noon + timedelta(days=1):%Y-%m-%dT00:00}")
            page.page.locator("[data-part='day']").fill("2999-01-01")
            expect(page.page.locator(".past [data-part='problem']")).to_contain_text("has not begun")
            assert page.errors == []


def test_a_service_without_a_history_says_how_to_keep_one(chromium: Browser, place: Place) -> None:
    place.move("a", x=1.0)
    with watched_page(chromium, place.url) as page:
        page.wait_for_map(1)
        page.page.locator("#history").click()
        expect(page.page.locator(".past [data-part='problem']")).to_contain_text("--data-dir FOLDER")
        assert page.errors == []


def test_the_trail_of_a_tag_begins_before_the_page_was_opened(chromium: Browser, tmp_path: Path) -> None:
    bench = live_api_bench(folder=tmp_path, retention=RETENTION)
    with running_server(bench.app(DASHBOARD), bench.stopping) as port:
        place = Place(bench, f"http://127.0.0.1:{port}/")
        now_ns = time.time_ns()
        for second in range(20):
            place.move("a", x=float(second - 19), y=2.0, speed=1.0, t_ns=now_ns - (19 - second) * SECOND)
        place.bench.write_history()
        with watched_page(chromium, place.url) as page:
            page.wait_for("dropanchor.trail('a').length >= 18")
            xs = [x for x in page.page.evaluate("dropanchor.trail('a')") if x is not None]
            assert xs == sorted(xs)
            assert (xs[0], xs[-1]) == (-19.0, 0.0)


def test_a_heat_map_shows_where_tags_were_and_how_much_is_left_out(chromium: Browser, past: tuple[Place, int]) -> None:
    place, end_ns = past
    with watched_page(chromium, link_to(place, end_ns, 299)) as page:
        wait_for_past(page, 3)
        page.wait_for("dropanchor.drawing().still")
        button, legend = page.page.locator("[data-part='heat']"), page.page.locator("#heat")
        expect(legend).to_be_hidden()
        x, y = page.page.evaluate("dropanchor.screen(100.5, 0.5)")
        button.focus()
        page.page.keyboard.press("Enter")
        expect(button).to_have_attribute("aria-pressed", "true")
        expect(legend.locator("h2")).to_have_text("Heat map: all tags")
        expect(legend.locator("[data-part='unit']")).to_have_text("Time in each square of 1 m")
        expect(legend.locator("[data-part='note']")).to_contain_text("Left out: 34 % of the time")  # turned, ambiguous
        page.wait_for("dropanchor.drawing().still")
        assert page.pixel(x, y) == pytest.approx((0, 32, 77, 217), abs=3)  # the darkest: each cell held a tag for 1 s
        page.page.locator("#table tbody tr[data-tag='first']").click()
        expect(legend.locator("h2")).to_have_text("Heat map: first")
        expect(legend.locator("[data-part='note']")).not_to_contain_text("Left out")
        expect(legend.locator("[data-part='high']")).to_have_text("1.0 s")
        page.wait_for("location.hash.includes('heat=1')")
        page.page.locator("[data-part='leave']").click()
        expect(legend).to_be_hidden()
        page.wait_for("!location.hash.includes('heat')")
        assert page.errors == []


def test_the_past_is_accessible_and_nothing_is_cut_off(chromium: Browser, past: tuple[Place, int], axe: str) -> None:
    place, end_ns = past
    link = link_to(place, end_ns, 155, tag="second", heat="1")
    with watched_page(chromium, link) as page:
        wait_for_past(page, 3)
        expect(page.page.locator("#heat [data-part='note']")).to_contain_text("Most:")
        assert violations(page.page, axe) == []
        cut = "[...document.querySelectorAll('.past *, #past-figures *, #heat *')].filter((e) => e.checkVisibility() "
        cut += "&& e.getBoundingClientRect().right > innerWidth + 1).map((e) => e.outerHTML)"
        site = "((site) => site.scrollWidth <= site.clientWidth)(document.getElementById('site'))"
        for look in every_look(page.page):
            assert page.page.evaluate(cut) == [], look
            assert page.page.evaluate(site), look
        page.page.set_viewport_size({"width": 390, "height": 844})
        page.page.reload()  # on a phone the legend begins folded
        expect(page.page.locator("#heat [data-part='high']")).to_have_text("1.0 s")
        expect(page.page.locator("#heat [data-part='note']")).to_be_hidden()
        covered = "((legend, map) => legend.height / map.height)(...['heat', 'map'].map("
        covered += "(id) => document.getElementById(id).getBoundingClientRect()))"
        assert page.page.evaluate(covered) < 0.35
        page.page.locator("#heat summary").click()
        expect(page.page.locator("#heat [data-part='note']")).to_contain_text("Most:")
        page.page.locator("[data-part='figures']").click()
        page.page.locator("#figures tbody tr").first.wait_for()
        assert violations(page.page, axe) == []
        assert page.errors == []
