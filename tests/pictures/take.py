"""Photograph the page: six tags of which one is explained, and the past with its heat map."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Locator, ViewportSize

from pictures.yard import TAGS, Yard, running_yard
from support.browser import Scheme, WatchedPage

SCHEMES: tuple[Scheme, ...] = ("light", "dark")
_SIZE, _SCALE = (1120, 660), 1.5
_QUALITY = 82
_LIVE_S, _DOUBTFUL = 50.0, "mower"
"""Some ten seconds later this tag has turned: it may be at either of two places, until the ranges decide."""
_EXPLAINED = f"""dropanchor.tags().some(({{ tag, state }}) => tag === "{_DOUBTFUL}" && state === "ambiguous")
    && document.querySelectorAll("[data-part='hypotheses']:not([hidden]) li").length > 1"""
_PAST_S = 1500.0


def take_live(chromium: Browser, folder: Path, into: Path) -> None:
    """Photograph the present, with a tag selected that the page explains, as `live-light.webp` and `live-dark.webp`."""
    with running_yard(folder, _LIVE_S) as yard, _page(chromium, f"{yard.service.url}/#tag={_DOUBTFUL}") as page:
        page.wait_for(f"dropanchor.drawing().visible === {len(TAGS)}")
        _press(page.page.locator("#side-bar"), "ArrowRight", 2)
        _press(page.page.locator("#detail-bar"), "ArrowUp", 2)
        for scheme, picture in _photographs_explained(page).items():
            _save(picture, into / f"live-{scheme}.webp")


def take_past(chromium: Browser, folder: Path, into: Path) -> None:
    """Photograph the heat map of a past of _PAST_S as `past-light.webp` and `past-dark.webp`."""
    with running_yard(folder, _PAST_S) as yard, _page(chromium, _link(yard)) as page:
        page.wait_for("dropanchor.past() && !dropanchor.past().loading")
        _press(page.page.locator("#side-bar"), "ArrowRight", 2)
        page.page.locator("[data-part='heat']").click()
        page.page.locator("#heat [data-part='scale']").wait_for()
        page.page.locator("#heat summary").click()
        page.wait_for("dropanchor.drawing().still")
        for scheme in SCHEMES:
            _save(_photograph(page, scheme), into / f"past-{scheme}.webp")


@contextmanager
def _page(chromium: Browser, url: str) -> Iterator[WatchedPage]:
    size = ViewportSize(width=_SIZE[0], height=_SIZE[1])
    context = chromium.new_context(viewport=size, device_scale_factor=_SCALE, locale="en-GB")
    page = WatchedPage(context.new_page())
    page.page.goto(url)
    page.wait_for("window.dropanchor?.status()")
    yield page
    context.close()


def _link(yard: Yard) -> str:
    """Return the address of a moment after two thirds of the past."""
    moments = {"from": 0.0, "to": _PAST_S, "at": _PAST_S * 2 / 3}
    values = {name: datetime.fromtimestamp(yard.began_ns / 1e9 + s, UTC) for name, s in moments.items()}
    return f"{yard.service.url}/#" + "&".join(f"{name}={t:%Y-%m-%dT%H:%M:%SZ}" for name, t in values.items())


def _press(bar: Locator, key: str, times: int) -> None:
    bar.focus()
    for _ in range(times):
        bar.press(key)
    bar.blur()


def _photographs_explained(page: WatchedPage) -> dict[Scheme, bytes]:
    """Photograph the page while it explains the tag, which it does for some seconds. A busy machine may be too late."""
    is_explained, pictures = False, dict[Scheme, bytes]()
    while not is_explained or not page.page.evaluate(_EXPLAINED):
        page.wait_for(_EXPLAINED, 120)
        page.page.wait_for_timeout(700)  # it may have been for an instant
        is_explained = page.page.evaluate(_EXPLAINED)
        pictures = {scheme: _photograph(page, scheme) for scheme in SCHEMES}
    return pictures


def _photograph(page: WatchedPage, scheme: Scheme) -> bytes:
    page.page.emulate_media(color_scheme=scheme)
    page.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return page.page.screenshot()


def _save(png: bytes, file: Path) -> None:
    with Image.open(BytesIO(png)) as picture:
        picture.convert("RGB").save(file, quality=_QUALITY, method=6)
