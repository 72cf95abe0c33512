"""An administrator shares the page; whoever has the link looks at it, read only, until it ends."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_schemas.shares import ShareRequest
from dropanchor_schemas.site import TagSettings
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.security import api_keys, share_links
from dropanchor_service.security.api_keys import ApiKeys
from dropanchor_service.security.identity import Authenticator, IdentityProvider, Scope
from dropanchor_service.security.share_links import ShareLinks
from service.dashboard.marked_language import speak_marked, unmarked
from service.dashboard.place import live_api_bench
from support.browser import open_page, watched_page
from support.http_server import running_server
from support.zenoh_router import wait_until

pytestmark = pytest.mark.browser


def test_a_link_of_a_group_is_created_copied_used_and_revoked(chromium: Browser, tmp_path: Path) -> None:
    keys, links = ApiKeys(tmp_path), ShareLinks(tmp_path)
    bench = live_api_bench()
    bench.now_ns = bench.answers.now_ns()
    bench.move("cart", "van", x=[1.0, 4.0], y=1.0)
    bench.answers.site.set_tag("van", TagSettings(group="vans"))
    secret = keys.add("boss", Scope.ADMIN)
    providers: dict[str, IdentityProvider] = {share_links.SOURCE: links, api_keys.SOURCE: keys}
    with running_server(bench.app(DASHBOARD, authenticator=Authenticator(providers)), bench.stopping) as port:
        url = f"http://127.0.0.1:{port}/"
        with open_page(chromium, url) as boss:
            boss.page.locator("#key").fill(secret)
            boss.page.keyboard.press("Enter")
            boss.page.locator("#group").select_option("vans")
            boss.page.get_by_role("button", name="Links and keys").click()
            boss.page.get_by_label("What it is for").fill("Visitors")
            boss.page.get_by_label("It shows").select_option("Only the group vans")
            boss.page.get_by_role("button", name="Create link").click()
            link = boss.page.locator("#shared-link")
            expect(link).to_contain_text("share=")
            address = link.inner_text()
            expect(boss.page.get_by_label("It shows")).to_have_value("group")
            with watched_page(chromium, address) as guest:
                expect(guest.page.locator("tr[data-tag]:visible")).to_have_count(1)
                assert set(guest.tags()) == {"van"}
                expect(guest.page.locator("#shared")).to_contain_text("Shared view of the group vans, read only, until")
                guest.page.locator("tr[data-tag='van']").click()
                for part in ("#edit", "#detail .settings", ".zones", "[data-part='json']"):
                    expect(guest.page.locator(part)).to_be_hidden()
                guest.page.get_by_role("button", name="Links and keys").click()
                expect(guest.page.locator("#link")).to_contain_text("share=")
                expect(guest.page.locator("#share")).to_be_hidden()
                guest.page.keyboard.press("Escape")
                boss.page.get_by_role("button", name="Revoke Visitors").click()
                wait_until(lambda: not links.of_site("default"))
                bench.move("van", x=5.0)
                expect(guest.page.locator("#ended")).to_contain_text("It was revoked")
                expect(guest.page.locator("#locked")).to_be_hidden()


def test_an_expired_link_says_when_it_expired_and_every_text_is_from_the_catalogue(
    chromium: Browser, tmp_path: Path
) -> None:
    old = ShareLinks(tmp_path, lambda: 1_700_000_000.0)
    _, secret = old.add("default", ShareRequest(tag="cart"))
    bench = live_api_bench()
    app = bench.app(DASHBOARD, authenticator=Authenticator({share_links.SOURCE: ShareLinks(tmp_path)}))
    with running_server(app, bench.stopping) as port:
        address = f"http://127.0.0.1:{port}/#share={secret}"
        with open_page(chromium, address) as page:
            expect(page.page.locator("#ended")).to_contain_text("It expired on 21 Nov 2023")
            expect(page.page.locator("#shared")).to_be_hidden()
        with open_page(chromium, address, locale="de-DE", prepare=speak_marked) as page:
            page.page.locator("#ended").wait_for(state="visible")
            assert {text for text in unmarked(page.page, "cart", "default") if "2023" not in text} == set()


def test_without_access_control_the_page_offers_no_share_link(chromium: Browser) -> None:
    bench = live_api_bench()
    with (
        running_server(bench.app(DASHBOARD), bench.stopping) as port,
        watched_page(chromium, f"http://127.0.0.1:{port}/") as page,
    ):
        with page.page.expect_response(lambda response: response.url.endswith("/shares")):
            page.page.get_by_role("button", name="Links and keys").click()
        expect(page.page.locator("#link")).to_contain_text("http")
        expect(page.page.locator("#share")).to_be_hidden()
        assert page.errors == []
