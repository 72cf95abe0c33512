"""The page speaks English and German: every text is from the catalogue, numbers and times are written to match."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Event

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.site import Anchor, Site
from dropanchor_schemas.wire import Reason
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.api.starting import create_starting_app
from dropanchor_service.engines.compilation import CompilationProgress
from dropanchor_service.estimation.columns import State, StateReason
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator
from service.dashboard.marked_language import speak_marked, unmarked
from service.dashboard.past_place import link_to, wait_for_past
from service.dashboard.place import Place, live_api_bench
from service.dashboard.test_evidence_in_browser import drive, select
from service.dashboard.zone_place import ZonePlace, disc, served, square, zone_place
from support.browser import WatchedPage, open_page, watched_page
from support.http_server import running_server

pytestmark = pytest.mark.browser

NAMES = [state.name.lower() for state in State]


def show_every_state(place: Place) -> None:
    """Place a tag in every state, each with another reason."""
    place.move(*NAMES, x=np.arange(float(len(NAMES))), y=1.0, state=list(State), reason=list(StateReason)[: len(NAMES)])
    tags, health = place.bench.answers.tags, place.bench.answers.health
    values = {
        "battery_fraction": 0.08,
        "rssi_dbm": -82.0,
        "temperature_c": 21.0,
        "spool_bytes": 2e6,
        "lost_messages": 3,
    }
    health.record(tags.register("lost").row, values, place.bench.answers.now_ns())


@pytest.fixture
def yard() -> Iterator[ZonePlace]:
    place = zone_place()
    place.put(square("yard", 1.0, 1.0, name="Yard", dwell_s=1.0), disc("dock", -3.0, 0.0, 1.5, name="Dock"))
    show_every_state(place)
    place.go("cart-3", -10.0, -10.0)
    place.go("cart-3", 3.0, 3.0)
    with served(place):
        yield place


def open_marked(stack: ExitStack, chromium: Browser, url: str) -> WatchedPage:
    return stack.enter_context(watched_page(chromium, url, locale="de-DE", prepare=speak_marked))


def test_every_text_about_tags_zones_anchors_and_settings_is_from_the_catalogue(
    chromium: Browser, yard: ZonePlace
) -> None:
    data = (*NAMES, "cart-3", "Yard", "Dock", "yard", "dock", "17", "default")
    with ExitStack() as stack:
        page = open_marked(stack, chromium, yard.url)
        page.page.locator("tr[data-tag='lost']").wait_for()
        page.page.locator("#care").wait_for(state="visible")
        found = set()
        for name in NAMES:
            page.page.locator(f"tr[data-tag='{name}']").click()
            found |= unmarked(page.page, *data)
        page.page.locator(f"tr[data-tag='{NAMES[0]}']").click(modifiers=["Control"])
        page.page.locator(f"tr[data-tag='{NAMES[0]}']").click(button="right")
        found |= unmarked(page.page, *data)
        page.page.locator("#menu button").first.click()
        page.page.locator("#detail .settings > summary").click()
        page.page.locator("[data-part='start']").click()
        found |= unmarked(page.page, *data)
        page.page.locator("[data-part='delete-tag']").click()
        found |= unmarked(page.page, *data)
        page.page.locator("#confirm [data-part='no']").click()
        page.page.locator("#edit").click()
        page.page.locator("[data-part='new']").first.click()
        found |= unmarked(page.page, *data)
        page.page.locator("#setup [data-part='close']").click()
        page.page.locator("#zone-list summary").click()
        page.page.locator("#zone-list .choose").first.wait_for()
        page.page.locator("#new-polygon").click()
        page.page.locator("#zone-form button").first.click()
        page.page.locator("#zone-form [data-part='problem']").wait_for(state="visible")
        page.page.locator("[data-part='corner']").click()
        found |= unmarked(page.page, *data)
        page.page.locator("#events summary").click()
        found |= unmarked(page.page, *data)
        page.page.locator("#confirm [data-part='yes']").click()  # what is drawn is not saved
        page.page.locator("#measure").click()
        page.page.locator("#map").click(position={"x": 100, "y": 200})
        page.page.locator("#map").click(position={"x": 200, "y": 200})
        found |= unmarked(page.page, *data)
        assert found == set()
        assert [error for error in page.errors if "422" not in error] == []  # the zone without an area


def test_every_text_about_measurements_is_from_the_catalogue(chromium: Browser) -> None:
    bench = live_api_bench(Site(anchors=[Anchor(id="17"), Anchor(id="18", x=20.0)]))
    with running_server(bench.app(DASHBOARD), bench.stopping) as port, ExitStack() as stack:
        place = Place(bench, f"http://127.0.0.1:{port}/")
        drive(place)
        tags = bench.answers.tags
        tags.rows.count_rejected(Reason.RANGE_ABSURD, np.full(3, tags.register("cart").row))
        page = open_marked(stack, chromium, place.url)
        select(page)
        assert unmarked(page.page, "cart", "17", "18", "default") == set()


def test_every_text_about_the_past_and_a_lost_connection_is_from_the_catalogue(
    chromium: Browser,
    past: tuple[Place, int],
) -> None:
    place, end_ns = past
    data = ("first", "second", "turned", "default", "Dock", "Ramp")
    with ExitStack() as stack:
        page = open_marked(stack, chromium, link_to(place, end_ns, 30.5, tag="first", heat="1"))
        wait_for_past(page, 3)
        page.page.locator("#past-figures").wait_for(state="visible")
        assert unmarked(page.page, *data) == set()
        page.page.locator("[data-part='leave']").click()
        place.bench.stopping.set()
        page.page.route("**/api/**", lambda route: route.abort())
        page.page.locator("#lost").wait_for(state="visible")
        assert unmarked(page.page, *data) == set()


def test_every_text_of_a_page_without_tags_without_a_key_or_before_the_start_is_from_the_catalogue(
    chromium: Browser, tmp_path: Path
) -> None:
    empty, locked = live_api_bench(), live_api_bench()
    keys = Authenticator({SOURCE: ApiKeys(tmp_path)})
    starting = create_starting_app(lambda: CompilationProgress().sentence)
    apps = [empty.app(DASHBOARD), locked.app(DASHBOARD, authenticator=keys), starting]
    for app, shown in zip(apps, ("#empty", "#locked", "#starting"), strict=True):
        with running_server(app, Event()) as port, ExitStack() as stack:
            url = f"http://127.0.0.1:{port}/"
            page = stack.enter_context(open_page(chromium, url, locale="de-DE", prepare=speak_marked))
            page.page.locator(shown).wait_for(state="visible")
            assert unmarked(page.page, "default") == set()
            empty.stopping.set()


@pytest.mark.parametrize("tag", ["", "#tag=phone-1"])
def test_every_text_of_the_page_of_a_tag_is_from_the_catalogue(chromium: Browser, place: Place, tag: str) -> None:
    url = f"{place.url}tag/{tag}"
    with open_page(chromium, url, locale="de-DE", prepare=speak_marked) as page:
        page.page.locator("#live" if tag else "#form").wait_for(state="visible")
        if tag:
            page.page.locator("#toggle").click()
            page.page.locator("#status[data-status='live']").wait_for()
        assert unmarked(page.page, "phone-1") == set()


def test_the_language_of_the_browser_is_used_and_another_one_is_chosen_remembered_and_in_the_address(
    chromium: Browser, place: Place
) -> None:
    place.move("cart", x=1.25, y=-2.5, speed=1.5)
    with watched_page(chromium, place.url, locale="de-AT") as page:
        page.page.locator("tr[data-tag='cart']").click()
        assert page.page.locator("html").get_attribute("lang") == "de"
        expect(page.page.locator("tr[data-tag='cart'] .c-x")).to_have_text("1,25")
        expect(page.page.locator("[data-part='v-speed']")).to_have_text("1,50 m/s")
        expect(page.page.locator("#detail dt").first).to_have_text("x (Ost)")
        page.page.get_by_role("button", name="Anzeige").click()
        page.page.get_by_label("Sprache").select_option("English")
        expect(page.page.locator("#count")).to_have_text("1 tag")
        assert "lang=en" in page.page.url
        expect(page.page.locator("tr[data-tag='cart'] .c-x")).to_have_text("1.25")
        page.page.goto(place.url)
        expect(page.page.locator("html")).to_have_attribute("lang", "en")
        page.page.goto(f"{place.url}?lang=de")
        expect(page.page.locator("html")).to_have_attribute("lang", "de")
        assert page.errors == []


def test_a_browser_in_a_language_that_the_page_lacks_gets_english(chromium: Browser, place: Place) -> None:
    with watched_page(chromium, place.url, locale="fr-FR") as page:
        assert page.page.locator("html").get_attribute("lang") == "en"
        assert page.errors == []


@pytest.mark.parametrize("size", [(1280, 800), (390, 844)], ids=["desktop", "phone"])
def test_german_texts_fit(chromium: Browser, yard: ZonePlace, size: tuple[int, int]) -> None:
    with watched_page(chromium, yard.url, locale="de-DE", size=size) as page:
        page.page.locator("tr[data-tag='degraded']").click()
        page.wait_for("dropanchor.drawing().still")
        cut = page.page.evaluate(
            """() => [...document.querySelectorAll("button, dt, dd, th, td:not(.c-tag), summary, .chip, h1, h2, h3")]
                .filter((one) => one.checkVisibility() && one.scrollWidth > one.clientWidth + 1)
                .map((one) => one.outerHTML.slice(0, 120))"""
        )
        assert cut == []
