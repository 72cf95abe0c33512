"""The address of the page holds the view: a copied link shows the same tag, map, filter, language and units."""

from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.site import TagSettings
from dropanchor_service.estimation.columns import State
from service.dashboard.place import Place
from support.browser import WatchedPage, watched_page

pytestmark = pytest.mark.browser

IS_WRITTEN = """(() => {
    const [x, y] = (new URLSearchParams(location.hash.slice(1)).get("centre") ?? "").split(",").map(Number);
    const [left, top] = dropanchor.screen(x, y);
    const { clientWidth, clientHeight } = document.getElementById("map");
    return dropanchor.drawing().still && Math.hypot(left - clientWidth / 2, top - clientHeight / 2) < 2;
})()"""  # the centre in the address is that of the map
VIEW = "(({ anchors }) => anchors()[0].pixel.map(Math.round))(dropanchor)"


def values_in(page: WatchedPage) -> dict[str, list[str]]:
    return parse_qs(urlsplit(page.page.url).fragment)


@pytest.fixture
def fleet(place: Place) -> Place:
    names = [f"cart-{number}" for number in range(5)]
    place.move(*names, "süd & co", x=np.arange(6.0), y=1.0, state=[State.TRACKING] * 5 + [State.LOST])
    place.bench.answers.site.set_tag("cart-1", TagSettings(group="forklifts"))
    return place


def test_a_copied_link_shows_the_same_tag_map_filter_language_and_units(chromium: Browser, fleet: Place) -> None:
    with watched_page(chromium, f"{fleet.url}?lang=de&length=ft") as page:
        page.page.locator("tr[data-tag='cart-1']").click()
        page.page.locator("#filter").fill("CART")
        page.page.locator("#group").select_option("forklifts")
        page.page.locator(".chip[data-state='tracking']").click()
        for _ in range(3):
            page.page.locator("#zoom-in").click()
        page.page.locator("#map").focus()
        page.page.keyboard.press("ArrowLeft")
        page.wait_for(f"location.hash.includes('group=') && {IS_WRITTEN}")
        link, view = page.page.url, page.page.evaluate(VIEW)
        page.page.get_by_role("button", name="Links und Schlüssel").click()
        expect(page.page.locator("#link")).to_have_text(link)
        assert page.errors == []
    with watched_page(chromium, link) as page:
        expect(page.page.locator("#count")).to_have_text("1 von 6 Tags")
        expect(page.page.locator("#detail h2")).to_have_text("cart-1")
        expect(page.page.locator("#filter")).to_have_value("cart")
        expect(page.page.locator("#group")).to_have_value("forklifts")
        expect(page.page.locator(".chip[data-state='tracking']")).to_have_attribute("aria-pressed", "true")
        expect(page.page.locator(".chip[data-state='lost']")).to_have_attribute("aria-pressed", "false")
        expect(page.page.locator("th.c-x")).to_have_text("x ft")
        page.wait_for("dropanchor.drawing().still")
        assert page.page.evaluate(VIEW) == pytest.approx(view, abs=2)
        page.page.locator("#show-all").click()
        page.page.locator("#detail [data-part='close']").click()
        page.page.locator("#fit").click()
        page.wait_for("!location.hash.includes('centre')")
        assert set(values_in(page)) == {"lang", "length"}
        assert page.errors == []


def test_a_link_to_a_tag_with_any_name_or_to_a_missing_one_opens(chromium: Browser, fleet: Place) -> None:
    with watched_page(chromium, f"{fleet.url}#tag=s%C3%BCd+%26+co&follow=1") as page:
        expect(page.page.locator("#detail h2")).to_have_text("süd & co")
        expect(page.page.locator("[data-part='follow']")).to_have_attribute("aria-pressed", "true")
        page.page.goto(f"{fleet.url}#tag=nobody&zoom=x&centre=1&hide=what")
        expect(page.page.locator("#detail")).to_be_hidden()
        expect(page.page.locator("#count")).to_have_text("6 tags")
        assert page.errors == []
