"""The dialog of the keys leads to the guide for what is open, in another tab, and the guide needs no other server."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.api.help.rendering import page as help_page
from service.dashboard.panel_place import set_up_place
from service.dashboard.zone_place import ZonePlace
from support.axe import violations
from support.browser import every_look, open_page, watched_page

SOURCE = (DASHBOARD / "page" / "guide.js").read_text()
PANELS = (DASHBOARD / "page" / "one_panel.js").read_text()
FILES = dict(re.findall(r'^const ([A-Z]+) = "([^"]+)";$', SOURCE, re.MULTILINE))
TARGETS = re.findall(r'^  (\w+): (?:([A-Z]+)(?: \+ )?)?(?:"([^"]*)")?,$', SOURCE, re.MULTILINE)


@pytest.fixture(scope="module")
def site() -> Iterator[ZonePlace]:
    with set_up_place() as place:
        yield place


def test_every_panel_but_the_keys_has_a_guide() -> None:
    assert {name for name, *_ in TARGETS} == set(re.findall(r"^  (\w+): \[", PANELS, re.MULTILINE)) - {"keys"}


@pytest.mark.parametrize(("panel", "file", "rest"), TARGETS, ids=lambda value: value)
def test_the_guide_of_a_panel_exists(panel: str, file: str, rest: str) -> None:
    path, _, heading = (FILES.get(file, "") + rest).partition("#")
    assert not heading or f' id="{heading}"' in help_page(path), panel


@pytest.mark.browser
def test_a_question_mark_leads_to_the_guide_for_what_is_open(chromium: Browser, site: ZonePlace) -> None:
    with watched_page(chromium, site.url) as page:
        page.wait_for_map(1)
        guide = page.page.locator("#guide")
        for press, title in (
            (None, "Use the page every day"),
            ("#edit-plans", "Show a floor plan"),
            ("tr[data-tag='cart-3'] td >> nth=0", "Read states"),
            ("#zone-list summary", "React to zones and events"),
        ):
            if press == "#zone-list summary":
                page.page.keyboard.press("Escape")  # leaves the details of the tag, which would count
            if press is not None:
                page.page.locator(press).click()
            page.page.keyboard.press("?")
            with page.page.context.expect_page() as opened:
                guide.click()
            expect(opened.value.locator("h1")).to_have_text(title)
            assert opened.value.evaluate("opener === null")
            assert page.page.evaluate("location.pathname") == "/"
            opened.value.close()
            page.page.keyboard.press("Escape")
        assert page.errors == []


@pytest.mark.browser
def test_the_german_page_says_that_the_guide_is_english(chromium: Browser, site: ZonePlace) -> None:
    with watched_page(chromium, site.url, locale="de-DE") as page:
        page.page.keyboard.press("?")
        expect(page.page.locator("#guide")).to_have_text("Anleitung (englisch): use the page")


@pytest.mark.browser
def test_the_documentation_fits_every_screen_and_is_searched_without_a_script(
    chromium: Browser, site: ZonePlace, axe: str
) -> None:
    with open_page(chromium, f"{site.url}help") as page:
        page.page.get_by_label("Search the documentation").fill("floor plan")
        page.page.keyboard.press("Enter")
        page.page.locator("main a").first.click()
        expect(page.page.locator("h1")).to_have_text("Show a floor plan")
        expect(page.page.locator("nav a[aria-current]")).to_have_text("Show a floor plan")
        for look in every_look(page.page):
            assert page.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), look
        assert violations(page.page, axe) == []
        assert page.origins == {site.url.rstrip("/")}
        assert page.errors == []
