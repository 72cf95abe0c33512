"""From the page alone: why a tag was where it was at a time that is past, and who had changed what."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from support.browser import running_chromium, watched_page
from support.live_tags import LiveTags, is_current
from support.patience import PATIENCE_S
from support.service import running_service
from support.zenoh_router import free_endpoint, router_process, wait_until

pytestmark = pytest.mark.browser
TAG = "sim-1"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with running_chromium() as browser:
        yield browser


def test_three_clicks_find_a_setting_that_was_changed_and_save_the_samples(chromium: Browser, tmp_path: Path) -> None:
    endpoint = free_endpoint()
    tags = LiveTags(endpoint, 1, 5)
    config = tags.write_settings(tmp_path)
    options = ("--config", str(config), "--data-dir", str(tmp_path / "data"), "--zenoh-connect", endpoint)
    path = f"/api/v1/tags/{TAG}"
    with router_process(endpoint), tags, running_service(*options) as service:
        wait_until(lambda: is_current(service, 1))
        settings = service.get(f"{path}/settings")
        service.put(f"{path}/settings", settings | {"mount_angle_rad": 1.5})
        changed_ns = time.time_ns()
        wait_until(lambda: service.get(f"{path}/pose")["t_ns"] > changed_ns + 4_000_000_000)
        wait_until(lambda: len(service.get(f"{path}/track")["poses"]) > 3)
        with watched_page(chromium, f"{service.url}/") as watched:
            page = watched.page
            page.locator(f"tr[data-tag='{TAG}']").click()
            expect(page.locator("[data-part=follow]")).to_be_visible()
            page.locator("#history").click()
            expect(page.locator("#then")).to_be_visible(timeout=1000 * PATIENCE_S)
            page.locator("#past [data-part=slider]").press("End")
            page.locator("#then [data-part=explain]").click()
            changed = page.locator("#then li", has_text="mount_angle_rad: null → 1.5")
            expect(changed).to_have_count(1, timeout=1000 * PATIENCE_S)
            with page.expect_download() as download:
                page.locator("#then [data-part=save]").click()
            assert Path(download.value.path()).read_bytes().startswith(b"\x89MCAP")
            assert watched.errors == []
