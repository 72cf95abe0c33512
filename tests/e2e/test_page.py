"""The whole path: tags publish over Zenoh, the service tracks them, and a real browser shows their motion."""

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from dropanchor_tag_client import TagClient
from support.browser import WatchedPage, watched_page
from support.patience import PATIENCE_S
from support.repeated import repeated
from support.service import running_service
from support.zenoh_router import free_endpoint, free_port

pytestmark = pytest.mark.browser

# Both tags drive round the same circle; the anchor at the origin lies outside. The start of one tag is known.
CENTRE_M, RADIUS_M, SPEED_MPS = (5.0, 1.0), 2.5, 1.0
CONFIG = """
[[site.anchors]]
id = "7"

[tags.cart]
start = { x = 7.5, y = 1.0, heading_rad = 1.570796 }
"""


@contextmanager
def driving_tag(name: str, endpoint: str) -> Iterator[None]:
    """Run a tag with a platform heading and ten ranges a second until the block ends."""
    begun_s = time.monotonic()

    def publish(_: int) -> None:
        turned = (time.monotonic() - begun_s) * SPEED_MPS / RADIUS_M
        x, y = CENTRE_M[0] + RADIUS_M * math.cos(turned), CENTRE_M[1] + RADIUS_M * math.sin(turned)
        client.publish_heading(math.remainder(turned + math.pi / 2, math.tau), std_rad=0.03)
        client.publish_range("7", math.hypot(x, y), std_m=0.1)

    with TagClient(name, connect=endpoint, connect_timeout_s=PATIENCE_S) as client, repeated(publish, 0.1):
        yield


def wait_until_moved(page: WatchedPage, tag: str, pixels: float) -> None:
    """Wait until the dot of a tag has moved by `pixels` on the screen."""
    x, y = page.tags()[tag]["pixel"]
    place = f"dropanchor.tags().find((tag) => tag.tag === '{tag}').pixel"
    page.wait_for(f"Math.hypot({place}[0] - {x}, {place}[1] - {y}) > {pixels}")


def test_dots_move_in_light_and_dark_and_all_requests_go_to_the_service(chromium: Browser, tmp_path: Path) -> None:
    config, endpoint = tmp_path / "yard.toml", free_endpoint()
    config.write_text(CONFIG)
    with ExitStack() as stack:
        url = stack.enter_context(running_service("--config", str(config), endpoint=endpoint)).url
        page = stack.enter_context(watched_page(chromium, url, reduced_motion="no-preference"))
        stack.enter_context(driving_tag("cart", endpoint))
        stack.enter_context(driving_tag("stray", endpoint))
        cart = page.page.locator("tr[data-tag='cart']")
        cart.wait_for()
        page.page.locator("tr[data-tag='stray']").wait_for()
        page.wait_for("dropanchor.tags().some((tag) => tag.tag === 'cart' && tag.semiMajor > 0)")
        wait_until_moved(page, "cart", 20)
        assert page.tags()["stray"]["state"] != "tracking"
        cart.click()
        dark = stack.enter_context(watched_page(chromium, url, scheme="dark", size=(390, 844)))
        dark.wait_for("dropanchor.tags().length === 2")
        assert dark.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(13, 18, 23)"
        for watched in (page, dark):
            assert watched.errors == []
            assert watched.origins == {url.rstrip("/")}


def test_the_page_marks_every_pose_as_out_of_date_until_the_service_is_back(chromium: Browser, tmp_path: Path) -> None:
    config, endpoint, port = tmp_path / "yard.toml", free_endpoint(), free_port()
    config.write_text(CONFIG)
    with ExitStack() as stack:
        with running_service("--config", str(config), "--port", str(port), endpoint=endpoint) as service:
            page = stack.enter_context(watched_page(chromium, service.url))
            stack.enter_context(driving_tag("cart", endpoint))
            page.page.locator("tr[data-tag='cart']").wait_for()
        page.page.locator("#lost").wait_for(state="visible")
        expect(page.page.locator("tr[data-tag='cart'] td.c-state")).to_have_text("Out of date")
        page.wait_for("dropanchor.tags()[0].state === 'outdated'")
        with running_service("--config", str(config), "--port", str(port), endpoint=endpoint):
            page.wait_for("dropanchor.status() === 'live'")
            page.page.locator("#lost").wait_for(state="hidden")
            frames = page.page.evaluate("dropanchor.streaming().frames")
            page.wait_for(f"dropanchor.streaming().frames > {frames} + 5")
            page.wait_for("dropanchor.tags().some(({ tag, state }) => tag === 'cart' && state !== 'outdated')")
