"""The page of a service that requires an API key."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser

from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from support.api import make_api_bench
from support.http_server import running_server
from support.patience import PATIENCE_S

pytestmark = pytest.mark.browser


def test_the_page_asks_for_a_key_stores_it_and_shows_the_tags(tmp_path: Path, chromium: Browser) -> None:
    now_s = 0.0
    keys = ApiKeys(tmp_path, lambda: now_s)
    secret = keys.add("dashboard", Scope.READ)
    bench = make_api_bench()
    bench.move("cart")
    app = bench.app(DASHBOARD, authenticator=Authenticator({SOURCE: keys}))
    with running_server(app, bench.stopping) as port, chromium.new_page() as page:
        page.set_default_timeout(1000 * PATIENCE_S)
        page.goto(f"http://127.0.0.1:{port}/")
        page.locator("#locked").wait_for()
        assert page.locator("#status-text").inner_text() == "Locked"
        assert not page.locator("#refused").is_visible()
        page.locator("#key").fill("a wrong one")
        page.keyboard.press("Enter")
        page.locator("#refused").wait_for()
        page.locator("#key").fill(secret)
        page.keyboard.press("Enter")
        page.locator("tr[data-tag='cart']").wait_for()
        assert not page.locator("#locked").is_visible()
        page.reload()
        page.locator("tr[data-tag='cart']").wait_for()
        assert secret not in page.content()
        assert page.evaluate("document.cookie + JSON.stringify(localStorage)") == "{}"
        keys.revoke("dashboard")
        now_s = 2.0
        page.locator("#locked").wait_for()
