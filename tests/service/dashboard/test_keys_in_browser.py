"""An administrator hands out keys on the page: to people, and to phones that become tags."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, expect

from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from service.dashboard.place import live_api_bench
from support.axe import violations
from support.browser import WatchedPage, open_page
from support.http_server import running_server

pytestmark = pytest.mark.browser


@contextmanager
def opened_keys(chromium: Browser, port: int, key: str) -> Iterator[tuple[WatchedPage, Locator]]:
    """Open the page with a key of an administrator, and its panel of keys."""
    with open_page(chromium, f"http://127.0.0.1:{port}/") as page:
        page.page.locator("#key").fill(key)
        page.page.keyboard.press("Enter")
        page.wait_for("window.dropanchor?.status() === 'live'")
        page.page.get_by_role("button", name="Links and keys").click()
        yield page, page.page.get_by_role("region", name="Keys")


def test_keys_are_made_used_and_revoked_without_a_terminal(chromium: Browser, axe: str, tmp_path: Path) -> None:
    keys = ApiKeys(tmp_path)
    bench = live_api_bench()
    bench.move("cart", x=1.0, y=1.0)
    boss = keys.add("boss", Scope.ADMIN)
    app = bench.app(DASHBOARD, authenticator=Authenticator({SOURCE: keys}))
    with running_server(app, bench.stopping) as port, opened_keys(chromium, port, boss) as (page, panel):
        panel.get_by_label("Who gets it").fill("Early shift")
        panel.get_by_label("It allows").select_option("Changing tags, anchors, plans and zones, too")
        panel.get_by_role("button", name="Create key").click()
        expect(panel.get_by_role("status")).to_contain_text("cannot be shown again")
        expect(panel.get_by_role("list")).to_contain_text("Early shift: write until")
        assert keys.identify(panel.locator("code").inner_text()).scope_in("default") is Scope.WRITE
        panel.get_by_label("Who gets it").fill("Anna's phone")
        panel.get_by_label("It allows").select_option("A phone or program to be a tag")
        panel.get_by_label("Tag", exact=True).fill("anna")
        panel.get_by_role("button", name="Create key").click()
        expect(panel.get_by_role("list")).to_contain_text("tag anna")
        link = panel.locator("code").inner_text()
        expect(panel.get_by_role("img", name="QR code of the link")).to_have_attribute(
            "src", re.compile("data:image/svg")
        )
        expect(panel).to_contain_text("so no phone reaches it")  # the test serves on this machine alone
        assert violations(page.page, axe, "#sharing") == []
        with open_page(chromium, link) as phone:
            expect(phone.page.locator("body")).to_contain_text("anna")
            expect(phone.page.locator("#form")).to_be_hidden()
        panel.get_by_label("Who gets it").fill("Early shift")
        panel.get_by_role("button", name="Create key").click()
        expect(panel.get_by_role("alert")).to_contain_text("There is a key named 'Early shift' already")
        panel.get_by_role("button", name="Revoke Early shift").click()
        expect(panel.get_by_role("button", name="Revoke Early shift")).to_be_hidden()
        assert sorted(key.name for key in keys.all().values()) == ["Anna's phone", "boss"]


def test_where_the_service_may_not_change_its_keys_the_page_lists_them_and_names_the_command(
    chromium: Browser, tmp_path: Path
) -> None:
    boss = ApiKeys(tmp_path).add("boss", Scope.ADMIN)
    ApiKeys(tmp_path).add("Early shift", Scope.WRITE)
    bench = live_api_bench()
    app = bench.app(DASHBOARD, authenticator=Authenticator({SOURCE: ApiKeys(tmp_path, is_copied=True)}))
    with running_server(app, bench.stopping) as port, opened_keys(chromium, port, boss) as (_, panel):
        expect(panel.get_by_role("list")).to_contain_text("Early shift: write, without an end")
        expect(panel).to_contain_text("Make and revoke them with `dropanchor key`")
        expect(panel.get_by_role("button")).to_have_count(0)
