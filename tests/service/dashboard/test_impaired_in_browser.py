"""The page says what of the service needs care, for as long as it does."""

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_service.api.app import DASHBOARD
from service.dashboard.place import live_api_bench
from support.browser import open_page
from support.http_server import running_server

pytestmark = pytest.mark.browser

SENTENCE = "zones.json is damaged; its last good copy is used: look at zones.json.damaged-1, then move it away"


def test_what_is_impaired_stands_above_the_map(chromium: Browser) -> None:
    bench = live_api_bench()
    bench.impaired = [SENTENCE]
    with running_server(bench.app(DASHBOARD), bench.stopping) as port:
        with open_page(chromium, f"http://127.0.0.1:{port}/") as page:
            banner = page.page.locator("#impaired")
            expect(banner).to_have_text(f"The service needs care: {SENTENCE}")
            expect(banner).to_be_visible()
            bench.impaired = []
            with page.page.expect_response("**/api/v1/health/ready"):
                page.page.reload()
            expect(banner).to_be_hidden()
        bench.stopping.set()
