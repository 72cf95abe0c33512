"""A real Chromium, and pages that record their requests and their errors."""

import asyncio
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal

import pytest
from playwright.sync_api import Browser, Error, Locator, Page, expect, sync_playwright

from support.patience import PATIENCE_S

expect.set_options(timeout=1000 * PATIENCE_S)
_EXECUTABLES = ("chromium-headless-shell", "chromium", "chromium-browser")
_ARGUMENTS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
Scheme = Literal["light", "dark"]

LOOKS: list[tuple[tuple[int, int], Scheme]] = [
    ((1280, 800), "light"),
    ((820, 1180), "dark"),
    ((390, 844), "dark"),
]
"""Every size, and both colour schemes."""


def every_look(page: Page) -> Iterator[str]:
    """Show a loaded page in every look and yield its name, such as `390x844-dark`. Then show the first one again."""
    for look in LOOKS:
        yield _show(page, look)
    _show(page, LOOKS[0])


def _show(page: Page, look: tuple[tuple[int, int], Scheme]) -> str:
    (width, height), scheme = look
    page.set_viewport_size({"width": width, "height": height})
    page.emulate_media(color_scheme=scheme)
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return f"{width}x{height}-{scheme}"


@contextmanager
def running_chromium() -> Iterator[Browser]:
    """Run Debian's Chromium, driven by Playwright. An event loop runs in this thread until the block ends.

    Chromium without the code of its windows comes first: the tests take a sixth less time with it.
    """
    executable = next(filter(None, map(shutil.which, _EXECUTABLES)), None)
    if executable is None:
        pytest.skip("Chromium is not installed: the browser tests need it")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=_ARGUMENTS)
        yield browser
        browser.close()


class PausedBrowser:
    """A browser that the files of a worker drive one after the other: to start one takes longer than many tests.

    Between them this thread has no running event loop, so that other tests can run their own.
    """

    def __init__(self, browser: Browser) -> None:
        self._browser, self._loop = browser, asyncio.get_running_loop()

    @contextmanager
    def paused(self) -> Iterator[None]:
        asyncio._set_running_loop(None)
        try:
            yield
        finally:
            asyncio._set_running_loop(self._loop)

    @contextmanager
    def driven(self) -> Iterator[Browser]:
        """Drive the paused browser until the block ends. Its pages are closed then."""
        asyncio._set_running_loop(self._loop)
        try:
            yield self._browser
        finally:
            for context in self._browser.contexts:  # those of tests that failed
                context.close()
            asyncio._set_running_loop(None)


def wait_for_truth(page: Page, expression: str, timeout_s: float, seen: Callable[[], object]) -> None:
    """Wait until a JavaScript expression is true. One that cannot be evaluated yet, such as of a list's last, is not.

    It is evaluated from outside, since the content security policy forbids it inside the page. seen: what else is
    told when it does not become true.
    """
    end_s = time.monotonic() + timeout_s
    while said := _untruth(page, expression):
        if time.monotonic() > end_s:
            raise AssertionError(f"not within {timeout_s} s: {expression}: {said}; the page: {seen()}")
        page.wait_for_timeout(50)


def _untruth(page: Page, expression: str) -> str:
    """Return nothing if the expression is true, or else its value or its error."""
    try:
        value = page.evaluate(expression)
    except Error as error:
        return str(error)
    return "" if value else f"it is {value!r}"


@dataclass
class WatchedPage:
    """A page, and the errors and warnings that it logged."""

    page: Page
    errors: list[str] = field(default_factory=list)

    @property
    def origins(self) -> set[str]:
        """The origins that the page sent requests to. A refused request is among the errors instead."""
        resources = "performance.getEntriesByType('resource').map(({ name }) => new URL(name).origin)"
        return {*self.page.evaluate(resources), self.page.evaluate("location.origin")}

    def tags(self) -> dict[str, dict[str, Any]]:
        """Return what the page knows about each tag, by name."""
        tags: list[dict[str, Any]] = self.page.evaluate("dropanchor.tags()")
        return {tag["tag"]: tag for tag in tags}

    def wait_for(self, condition: str, timeout_s: float = PATIENCE_S) -> None:
        """Wait until a JavaScript expression is true."""
        status = "window.dropanchor?.status?.()"
        wait_for_truth(self.page, condition, timeout_s, lambda: (self.page.evaluate(status), self.errors))

    def wait_for_map(self, visible: int) -> None:
        """Wait until the site is loaded, `visible` tags are on the map, and the map has stopped moving."""
        site = "document.getElementById('site').textContent"
        self.wait_for(f"{site} && dropanchor.drawing().still && dropanchor.drawing().visible === {visible}")

    def pixel(self, x: float, y: float) -> tuple[int, ...]:
        """Return red, green, blue and opacity of the map at a place in CSS pixels."""
        return self.pixels([(x, y)])[0]

    def pixels(self, places: Sequence[tuple[float, float]]) -> list[tuple[int, ...]]:
        """Return the same at several places, read at once."""
        script = """(places) => {
            const inside = places.map(([x, y]) => [x, y].map((value) => Math.round(value * devicePixelRatio)));
            const [left, top] = [0, 1].map((axis) => Math.min(...inside.map((place) => place[axis])));
            const [right, bottom] = [0, 1].map((axis) => Math.max(...inside.map((place) => place[axis])) + 1);
            const pen = document.getElementById("map").getContext("2d");
            const { data } = pen.getImageData(left, top, right - left, bottom - top);
            return inside.map(([x, y]) => {
                const at = 4 * ((y - top) * (right - left) + x - left);
                return [...data.subarray(at, at + 4)];
            });
        }"""
        return [tuple(colour) for colour in self.page.evaluate(script, [list(place) for place in places])]


def drag(page: Page, handle: Locator, dx: int, dy: int) -> None:
    """Drag an element with the mouse by so many pixels."""
    box = handle.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + dx / 2, y + dy / 2)
    page.mouse.move(x + dx, y + dy)
    page.mouse.up()


@contextmanager
def watched_page(
    browser: Browser,
    url: str,
    scheme: Scheme = "light",
    size: tuple[int, int] = (1280, 800),
    reduced_motion: Literal["reduce", "no-preference"] = "reduce",
    locale: str = "en-GB",
    prepare: Callable[[Page], object] = lambda _: None,
) -> Iterator[WatchedPage]:
    """Open the page, wait until its stream is live, and close it at the end. Arguments as for `open_page`."""
    with open_page(browser, url, scheme, size, reduced_motion, locale, prepare) as watched:
        watched.wait_for("window.dropanchor?.status() === 'live'")
        yield watched


@contextmanager
def open_page(
    browser: Browser,
    url: str,
    scheme: Scheme = "light",
    size: tuple[int, int] = (1280, 800),
    reduced_motion: Literal["reduce", "no-preference"] = "reduce",
    locale: str = "en-GB",
    prepare: Callable[[Page], object] = lambda _: None,
) -> Iterator[WatchedPage]:
    """Open the page, and close it at the end.

    size: CSS pixels. reduced_motion: with motion, the map draws tens of times before it is still. prepare: is called
    before the page loads.
    """
    context = browser.new_context(
        viewport={"width": size[0], "height": size[1]},
        color_scheme=scheme,
        reduced_motion=reduced_motion,
        locale=locale,
    )
    context.set_default_timeout(1000 * PATIENCE_S)
    watched = WatchedPage(context.new_page())
    page = watched.page
    prepare(page)
    page.on("pageerror", lambda error: watched.errors.append(str(error)))
    page.on("console", lambda line: _note(watched.errors, line.type, line.text))
    page.goto(url)
    yield watched
    context.close()


def _note(errors: list[str], kind: str, text: str) -> None:
    """Note what the page logged, but not that the network of this machine changed, which is not its doing."""
    if kind in ("error", "warning") and "ERR_NETWORK_CHANGED" not in text:
        errors.append(text)
