"""The accessibility checker axe-core finds no violation in any view of the page."""

import time
from contextlib import ExitStack

import numpy as np
import pytest
from playwright.sync_api import Browser

from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.estimation.columns import State
from service.dashboard.place import Place, live_api_bench
from support.axe import violations
from support.browser import WatchedPage, watched_page
from support.http_server import running_server

pytestmark = pytest.mark.browser


def show_every_state(place: Place, **when: int) -> None:
    names = [state.name.lower() for state in State]
    place.move(*names, x=np.arange(float(len(names))), y=1.0, state=list(State), sigma_pos=0.2, range=5.0, **when)
    place.bench.answers.tags.register("poseless")


def assert_no_violation(page: WatchedPage, axe: str, within: str = "html") -> None:
    assert violations(page.page, axe, within) == []


def test_no_violation_without_a_tag(chromium: Browser, place: Place, axe: str) -> None:
    with watched_page(chromium, place.url) as page:
        page.page.locator("#empty").wait_for(state="visible")
        assert_no_violation(page, axe)


def test_no_violation_with_tags_in_every_state_fresh_and_old_listed_hidden_and_selected(
    chromium: Browser, place: Place, axe: str
) -> None:
    with watched_page(chromium, place.url) as page:
        show_every_state(place)
        page.page.locator("tr[data-tag='lost']").wait_for()
        assert_no_violation(page, axe)
        for state in ("ambiguous", "tracking"):
            page.page.locator(f"tr[data-tag='{state}']").click()
            assert_no_violation(page, axe)
        page.page.locator(".chip[data-state='lost']").click()
        show_every_state(place, t_ns=time.time_ns())
        page.page.locator("tr[data-stale='2']").first.wait_for()
        assert_no_violation(page, axe)


def test_no_violation_after_the_connection_is_lost(chromium: Browser, axe: str) -> None:
    bench = live_api_bench()
    with ExitStack() as pages:
        with running_server(bench.app(DASHBOARD), bench.stopping) as port:
            place = Place(bench, f"http://127.0.0.1:{port}/")
            page = pages.enter_context(watched_page(chromium, place.url))
            show_every_state(place)
            page.page.locator("tr[data-tag='tracking']").click()
        page.page.locator("#lost").wait_for(state="visible")
        assert_no_violation(page, axe)
