"""The first hour on the page: simulated tags at the press of a button, which end with the service, however it ends."""

import signal
from contextlib import suppress
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from support.browser import watched_page
from support.service import running_service
from support.zenoh_router import wait_until

pytestmark = pytest.mark.browser


def test_six_simulated_tags_come_at_a_button_and_go_with_undo_or_the_service(chromium: Browser) -> None:
    with running_service() as service, watched_page(chromium, f"{service.url}/") as page:
        page.page.get_by_role("button", name="Simulate six tags").click()
        expect(page.page.locator("#empty")).to_be_hidden()
        page.wait_for("dropanchor.tags().filter(({ state }) => state === 'tracking').length === 6")
        (first,) = children(service.process.pid)
        page.page.get_by_role("button", name="Undo").click()
        wait_until(lambda: not is_running(first))
        page.page.get_by_role("button", name="Redo").click()
        wait_until(lambda: children(service.process.pid) != [])
        (second,) = children(service.process.pid)
        service.stop(signal.SIGKILL)
        wait_until(lambda: not is_running(second))


def children(parent: int) -> list[int]:
    """Return the processes with simulated tags that a process has started, from whichever thread."""
    lists = Path(f"/proc/{parent}/task").glob("*/children")
    return [int(child) for one in lists for child in one.read_text().split() if is_running(int(child))]


def is_running(process: int) -> bool:
    with suppress(OSError):
        return "simulate" in Path(f"/proc/{process}/cmdline").read_text()  # empty for one that has ended
    return False
