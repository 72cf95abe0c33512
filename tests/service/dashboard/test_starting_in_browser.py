"""The page while the service starts: it shows the progress and goes on by itself."""

from threading import Event

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.api.starting import CurrentApp, create_starting_app
from service.dashboard.place import live_api_bench
from support.browser import open_page
from support.http_server import running_server

pytestmark = pytest.mark.browser


def test_the_page_shows_the_progress_and_then_the_map(chromium: Browser) -> None:
    seconds = iter(range(1000))
    app = CurrentApp(create_starting_app(lambda: f"Compiling: {next(seconds)} s so far."))
    with running_server(app, Event()) as port, open_page(chromium, f"http://127.0.0.1:{port}/") as page:
        progress = page.page.locator("#progress")
        expect(progress).to_contain_text("s so far")
        earlier = progress.inner_text()
        expect(progress).not_to_have_text(earlier)
        assert page.page.locator("#status-text").inner_text() == "Starting"
        assert page.page.locator("#lost").is_hidden()
        bench = live_api_bench()
        app.app = bench.app(DASHBOARD)
        page.wait_for("window.dropanchor.status() === 'live'")
        assert page.page.locator("#starting").is_hidden()
        page.page.locator("#empty").wait_for(state="visible")
        bench.stopping.set()
