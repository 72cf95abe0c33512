"""The overview of several sites, and the page of one of them, in a real browser."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.site import Georeference
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from support.axe import violations
from support.browser import open_page
from support.http_server import running_server
from support.sites import app_of_sites, make_sites

pytestmark = pytest.mark.browser

PLACES = {"hamburg": (53.55, 10.0), "Lager Süd": (48.14, 11.58), "lab": None}


@contextmanager
def company(authenticator: Authenticator | None = None) -> Iterator[str]:
    """Serve three sites with a tag `cart` each, the last of which is nowhere on Earth. Yield the address."""
    sites, stopping = make_sites(*PLACES), Event()
    for site, place in zip(sites, PLACES.values(), strict=True):
        if place is not None:
            georeference = Georeference(lat=place[0], lon=place[1])
            site.store.set_site(site.store.site.model_copy(update={"georeference": georeference}))
    with running_server(app_of_sites(sites, authenticator, stopping=stopping), stopping) as port:
        yield f"http://127.0.0.1:{port}/"


def test_the_overview_leads_to_the_page_of_a_site_and_its_chooser_to_another(chromium: Browser, axe: str) -> None:
    with company() as address, open_page(chromium, address) as watched:
        page = watched.page
        expect(page.locator("#sites tr")).to_have_count(3)
        assert page.url == f"{address}sites/"
        expect(page.locator("#sites tr").first).to_contain_text("1 Tracking")
        expect(page.locator("#map a")).to_have_count(2)
        page.locator("#find").fill("süd")
        expect(page.locator("#sites tr")).to_have_count(1)
        expect(page.locator("#map a")).to_have_count(1)
        page.locator("#find").fill("")
        expect(page.locator("#sites tr")).to_have_count(3)
        assert violations(page, axe) == []

        page.get_by_role("row").get_by_role("link", name="Lager Süd").click()
        watched.wait_for("window.dropanchor?.tags().length === 1 && dropanchor.tags()[0].x === 2")
        page.get_by_role("button", name="Links and keys").click()
        expect(page.locator("#share")).to_be_hidden()  # without access control there is nothing to share
        page.keyboard.press("Escape")
        expect(page.locator("#zones")).to_be_visible()
        chooser = page.get_by_role("combobox", name="Site", exact=True)
        expect(chooser).to_have_value("Lager Süd")
        expect(page.locator("#site")).to_be_hidden()
        chooser.select_option("lab")
        expect(page).to_have_url(re.compile(r"/\?site=lab"))
        watched.wait_for("window.dropanchor?.tags().length === 1 && dropanchor.tags()[0].x === 3")
        page.get_by_role("link", name="All sites").click()
        expect(page.locator("#sites tr")).to_have_count(3)
        assert watched.errors == []


def test_a_key_of_one_site_shows_this_site_alone(chromium: Browser, tmp_path: Path) -> None:
    keys = ApiKeys(tmp_path)
    secret = keys.add("lab", Scope.READ, site="lab")
    with company(Authenticator({SOURCE: keys})) as address, open_page(chromium, address) as watched:
        page = watched.page
        page.locator("#key").fill(secret)
        page.keyboard.press("Enter")
        expect(page.locator("#sites tr")).to_have_count(1)
        page.get_by_role("link", name="lab").click()
        watched.wait_for("window.dropanchor?.status() === 'live'")
        expect(page.locator("#site")).to_have_text("lab")
        expect(page.locator("nav#sites")).to_be_hidden()
        page.goto(f"{address}?site=hamburg")
        expect(page.locator("#locked")).to_be_visible()
