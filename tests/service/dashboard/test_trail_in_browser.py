"""The dialog of settings and changes: where values come from, who changed what, and taking either back."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, expect

from dropanchor_schemas.shares import ShareRequest
from dropanchor_schemas.site import Anchor, Site, TagSettings
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.persistence.site import open_sites
from dropanchor_service.security import api_keys, share_links
from dropanchor_service.security.api_keys import ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from dropanchor_service.security.share_links import ShareLinks
from dropanchor_service.settings.sources import load_settings
from dropanchor_service.store import LatestPoses, SiteStore
from service.dashboard.marked_language import speak_marked, unmarked
from service.dashboard.place import live_api_bench
from support.api import ApiBench
from support.axe import violations
from support.browser import WatchedPage, open_page, watched_page
from support.http_server import running_server

pytestmark = pytest.mark.browser

SETTINGS = """
[site]
name = "Yard"
anchors = [{ id = "1", z = 2.5 }, { id = "2", x = 9.0 }]
[tags.cart]
height_m = 1.2
"""


class Yard:
    """A served page of a site whose settings are from a file. secrets: a key for each scope, and a share link."""

    def __init__(self, folder: Path) -> None:
        (folder / "yard.toml").write_text(SETTINGS)
        sites = open_sites(load_settings(folder / "yard.toml", environment={}))
        keys, links = ApiKeys(folder), ShareLinks(folder)
        self.store: SiteStore = sites[0].store
        sites[0].tags.register("cart")
        self.bench = ApiBench(Answers(self.store, sites[0].tags, LatestPoses()))
        self.bench.answers.now_ns = live_api_bench().answers.now_ns
        self.authenticator = Authenticator({share_links.SOURCE: links, api_keys.SOURCE: keys})
        self.secrets = {scope.word: keys.add(scope.word, scope) for scope in Scope}
        self.secrets["link"] = links.add("default", ShareRequest())[1]

    @contextmanager
    def served(self, secured: bool = True) -> Iterator[str]:
        app = self.bench.app(DASHBOARD, authenticator=self.authenticator if secured else None)
        with running_server(app, self.bench.stopping) as port:
            yield f"http://127.0.0.1:{port}/"


@pytest.fixture
def yard(tmp_path: Path) -> Yard:
    return Yard(tmp_path)


def opened(watched: WatchedPage, secret: str | None = None) -> Locator:
    """Open the dialog, with a key if there is one."""
    page = watched.page
    if secret is not None:
        page.locator("#key").fill(secret)
        page.keyboard.press("Enter")
    watched.wait_for("window.dropanchor?.status() === 'live'")
    page.locator("#options").click()
    page.locator("#show-trail").click()
    dialog = page.locator("#trail")
    expect(dialog.locator("li").first).to_be_visible()
    return dialog


def test_what_was_set_here_is_given_back_to_the_settings_file(chromium: Browser, yard: Yard, axe: str) -> None:
    yard.store.set_site(yard.store.site.model_copy(update={"name": "Hof"}))
    yard.store.set_anchor(Anchor(id="1", x=50.0, z=2.5))
    yard.store.set_anchor(Anchor(id="3"))
    yard.store.remove_anchor("2")
    yard.store.set_tag("cart", TagSettings(height_m=1.5))
    with yard.served() as url, open_page(chromium, url) as page:
        dialog = opened(page, yard.secrets["admin"])
        values = dialog.get_by_role("list", name="Where values come from")
        expect(values).to_contain_text("site › name: Hof (set here) instead of Yard (yard.toml)")
        expect(values).to_contain_text(
            "anchors › 1: x 50, y 0, z 2.5, mirrors_behind true (set here) "
            "instead of x 0, y 0, z 2.5, mirrors_behind true (yard.toml)"
        )
        expect(values).to_contain_text("tags › cart › height_m: 1.5 (set here) instead of 1.2")
        assert violations(page.page, axe, "#trail") == []
        backs = dialog.get_by_role("button", name="Give back")
        for left in range(5, 0, -1):
            expect(backs).to_have_count(left)
            backs.first.click()
        expect(backs).to_have_count(0)
        expect(dialog.get_by_role("alert")).to_be_hidden()
    assert yard.store.site == yard.store.configured.site
    assert yard.store.tags == yard.store.configured.tags


def test_a_deleted_tag_of_the_settings_file_is_given_back(chromium: Browser, yard: Yard) -> None:
    yard.store.remove_tag("cart", 5)
    with yard.served(secured=False) as url, watched_page(chromium, url) as page:
        dialog = opened(page)
        dialog.get_by_role("button", name="Give back tags › cart").click()
        expect(dialog.get_by_role("button", name="Give back")).to_have_count(0)
        page.page.keyboard.press("Escape")
        page.page.locator("tr[data-tag='cart']").click()
        page.page.locator("#detail .settings > summary").click()
        expect(page.page.locator("#setting-height_m")).to_contain_text("Default: 0 m. In force: yard.toml.")
        expect(page.page.locator("#setting-name")).to_contain_text("In force: default.")
    assert yard.store.tags == yard.store.configured.tags


def test_who_changed_what_is_shown_and_undone_unless_it_was_changed_since(chromium: Browser, yard: Yard) -> None:
    moved = {"id": "1", "x": 50.0}
    with yard.served() as url, open_page(chromium, url) as page:
        headers = {"authorization": f"Bearer {yard.secrets['write']}"}
        for path, body in (("anchors/1", moved), ("tags/cart/settings", {"name": "Cart"})):
            assert page.page.request.put(f"{url}api/v1/{path}", data=body, headers=headers).ok
        dialog = opened(page, yard.secrets["admin"])
        entries = dialog.get_by_role("list", name="Who changed what")
        expect(entries).to_contain_text("write: anchor 1 was changed. x: 0 → 50; z: 2.5 → 0")
        dialog.get_by_role("button", name="Undo: anchor 1").click()
        expect(entries).to_contain_text("admin: anchor 1 was changed. x: 50 → 0; z: 0 → 2.5")
        assert yard.store.anchor("1") == Anchor(id="1", z=2.5)
        yard.store.set_tag("cart", TagSettings(name="Theirs"))
        dialog.get_by_role("button", name="Undo: tag cart").last.click()
        expect(dialog.get_by_role("alert")).to_have_text("It has been changed since, so this was not done.")
        assert yard.store.tags["cart"].name == "Theirs"
        for format_, button in (("csv", "Save as CSV"), ("jsonl", "Save as JSON lines")):
            with page.page.expect_download() as download:
                dialog.get_by_role("button", name=button).click()
            assert download.value.suggested_filename == f"changes.{format_}"


def test_many_changes_come_page_by_page(chromium: Browser, yard: Yard) -> None:
    with yard.served(secured=False) as url, watched_page(chromium, url) as page:
        for number in range(31):
            yard.store.set_anchor(Anchor(id="1", x=number + 1.0))
        dialog = opened(page)
        entries = dialog.get_by_role("list", name="Who changed what").get_by_role("listitem")
        expect(entries).to_have_count(30)
        dialog.get_by_role("button", name="Show earlier changes").click()
        expect(entries).to_have_count(31)
        expect(dialog.get_by_role("button", name="Show earlier changes")).to_be_hidden()


def test_who_may_not_write_gets_no_buttons_and_a_link_no_dialog(chromium: Browser, yard: Yard) -> None:
    yard.store.set_anchor(Anchor(id="1", x=50.0))
    with yard.served() as url:
        with open_page(chromium, url) as page:
            dialog = opened(page, yard.secrets["read"])
            expect(dialog).to_contain_text("set here")
            expect(dialog.get_by_role("button", name="Give back")).to_have_count(0)
            expect(dialog.get_by_role("button", name="Undo")).to_have_count(0)
        with open_page(chromium, f"{url}#share={yard.secrets['link']}") as guest:
            guest.wait_for("window.dropanchor?.status() === 'live'")
            guest.page.locator("#options").click()
            expect(guest.page.locator("#language")).to_be_visible()
            expect(guest.page.locator("#show-trail")).to_be_hidden()


def test_every_text_of_the_dialog_is_from_the_catalogue(chromium: Browser, yard: Yard) -> None:
    with (
        yard.served(secured=False) as url,
        open_page(chromium, url, locale="de-DE", prepare=speak_marked) as page,
    ):
        yard.store.remove_anchor("2")
        yard.store.set_site(Site(name="7", anchors=yard.store.site.anchors))
        dialog = opened(page)
        expect(dialog.locator("li").first).to_be_visible()
        known = ("site › name", "name: Yard → 7", "site › anchors", "yard.toml", "tags › cart", "tag_defaults", "x 9")
        texts = {text for text in unmarked(page.page, "default", "cart", "Yard") if not any(k in text for k in known)}
        assert texts == set()
