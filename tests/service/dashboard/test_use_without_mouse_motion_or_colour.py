"""The page works by keyboard, without motion and without colour, also in its dialogs and on the wall."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from dropanchor_service.estimation.columns import Frame, State
from service.dashboard.place import Place
from support.axe import violations
from support.browser import Scheme, watched_page

pytestmark = pytest.mark.browser

light_and_dark = pytest.mark.parametrize("scheme", ["light", "dark"])
NAMES = [*(state.name.lower() for state in State), "relative"]
CROP = 24
MOVING = """() => [...document.querySelectorAll("*"), document.documentElement].filter((one) => {
    const { transitionDuration, animationName } = getComputedStyle(one);
    return animationName !== "none" || transitionDuration.split(", ").some((time) => parseFloat(time) > 0);
}).map((one) => one.outerHTML.slice(0, 80))"""
DRAWN_IN_200_MS = """new Promise((done) => {
    const { drawings } = dropanchor.drawing();
    setTimeout(() => done(dropanchor.drawing().drawings - drawings), 200);
})"""
COLOURS = """(names) => {
    const style = getComputedStyle(document.documentElement);
    return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}"""


def show_every_state(place: Place) -> None:
    """Place a tag in every state 4 m from the next, without an ellipse, and one without north."""
    x = 4.0 * np.arange(len(NAMES))
    states = [*State, State.TRACKING]
    frames = [Frame.SITE] * len(State) + [Frame.RELATIVE]
    place.move(*NAMES, x=x, y=3.0, heading=np.nan, state=states, frame=frames, cov=np.eye(3) * 1e-12)


def luminance(rgb: Any) -> Any:
    """Return the relative luminance (WCAG 2) of colours with channels from 0 to 255."""
    share = np.asarray(rgb, float) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


def shape_of(page: Page, x: float, y: float) -> Any:
    """Return which pixels around a place of the map differ in luminance from its ground."""
    script = """([x, y, size]) => [...document.getElementById("map").getContext("2d")
        .getImageData(Math.round(x - size / 2), Math.round(y - size / 2), size, size).data]"""
    data = np.array(page.evaluate(script, [x, y, CROP])).reshape(CROP, CROP, 4)
    lit = luminance(data[..., :3])
    return np.abs(lit - np.median(lit)) > 0.25 * np.abs(lit - np.median(lit)).max()


@light_and_dark
def test_the_markers_of_the_states_differ_in_shape_and_stand_out_without_any_colour(
    chromium: Browser, place: Place, scheme: Scheme
) -> None:
    show_every_state(place)
    with watched_page(chromium, place.url, scheme=scheme) as page:
        page.wait_for_map(len(NAMES))
        tags = page.tags()
        shapes = {tags[name]["state"]: shape_of(page.page, *tags[name]["pixel"]) for name in NAMES}
        assert len(shapes) == len(NAMES)
        for one, other in combinations(shapes, 2):
            assert np.count_nonzero(shapes[one] ^ shapes[other]) >= 12, (one, other)
        symbols = page.page.locator("symbol").evaluate_all("(all) => all.map((one) => one.innerHTML)")
        assert len(set(symbols)) == len(symbols) == len(NAMES) + 1  # and one for poses that are out of date


@light_and_dark
def test_the_colours_of_the_states_have_enough_contrast(chromium: Browser, place: Place, scheme: Scheme) -> None:
    with watched_page(chromium, place.url, scheme=scheme) as page:
        grounds = ("panel", "map", "raised")
        colours: dict[str, str] = page.page.evaluate(COLOURS, [*NAMES, *grounds])
        rgb = {name: [int(text[at : at + 2], 16) for at in (1, 3, 5)] for name, text in colours.items()}
        lit = {name: float(luminance(value)) for name, value in rgb.items()}
        for name in NAMES:
            for ground in grounds:
                low, high = sorted((lit[name], lit[ground]))
                assert (high + 0.05) / (low + 0.05) >= 4.5, (name, ground)


def test_nothing_moves_by_itself_with_reduced_motion(chromium: Browser, place: Place) -> None:
    show_every_state(place)
    with watched_page(chromium, place.url) as page:
        page.page.locator("tr[data-tag='tracking']").click()
        page.page.get_by_role("button", name="Display").click()
        assert page.page.evaluate(MOVING) == []
        page.page.keyboard.press("Escape")
        page.wait_for("dropanchor.drawing().still")
        place.move("tracking", x=9.0, y=3.5)
        page.wait_for("dropanchor.tags().find(({ tag }) => tag === 'tracking').x === 9")
        page.wait_for("dropanchor.drawing().still")
        assert page.page.evaluate(DRAWN_IN_200_MS) <= 5  # it jumped, and glides no more
    with watched_page(chromium, place.url, reduced_motion="no-preference") as page:
        assert page.page.evaluate(MOVING) != []
        page.wait_for("dropanchor.drawing().still")
        drawings = page.page.evaluate("dropanchor.drawing().drawings")
        place.move("tracking", x=8.0, y=3.5)
        page.wait_for("dropanchor.tags().find(({ tag }) => tag === 'tracking').x === 8 && dropanchor.drawing().still")
        assert page.page.evaluate("dropanchor.drawing().drawings") - drawings > 5  # it glided, and has arrived


def test_a_question_mark_shows_the_keys_and_keys_go_where_one_types(chromium: Browser, place: Place) -> None:
    place.move("cart", x=1.0, y=1.0)
    with watched_page(chromium, place.url) as watched:
        page = watched.page
        page.locator("tr[data-tag='cart']").click()
        page.keyboard.press("?")
        keys = page.get_by_role("dialog", name="Keyboard")
        expect(keys).to_be_visible()
        assert keys.locator("dt").count() == keys.locator("dd").count() == 16
        page.keyboard.press("/")
        expect(page.locator("#filter")).not_to_be_focused()
        page.keyboard.press("Escape")
        expect(keys).to_be_hidden()
        expect(page.locator("#detail h2")).to_have_text("cart")
        page.keyboard.press("/")
        expect(page.locator("#filter")).to_be_focused()
        page.keyboard.type("?/x")
        expect(page.locator("#filter")).to_have_value("?/x")
        expect(keys).to_be_hidden()
        page.locator("#filter").fill("")
        page.locator("#edit").click()
        page.locator("#setup [data-part='new']").click()
        page.locator("#setup [name='id']").press_sequentially("a/b?")
        expect(page.locator("#setup [name='id']")).to_have_value("a/b?")
        page.get_by_role("button", name="Display").click()
        page.get_by_role("button", name="Keyboard").click()
        expect(keys).to_be_visible()
        assert watched.errors == []


def test_no_violation_in_the_dialogs_and_on_the_wall(chromium: Browser, place: Place, axe: str) -> None:
    show_every_state(place)
    with watched_page(chromium, place.url) as page:
        page.page.get_by_role("button", name="Display").click()
        assert violations(page.page, axe, "#display") == []
        page.page.get_by_role("button", name="Keyboard").click()
        assert violations(page.page, axe, "#keys") == []
        page.page.goto(f"{place.url}?kiosk&lang=de#tag=tracking")
        page.wait_for("window.dropanchor?.status() === 'live'")
        page.page.locator("#detail").wait_for()
        assert violations(page.page, axe) == []
