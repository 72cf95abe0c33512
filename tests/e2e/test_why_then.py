"""From the page alone: why a tag was wrong at a time that is past, and where it would have been otherwise."""

import time
from collections.abc import Iterator
from math import dist
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from dropanchor_schemas.site import Anchor
from dropanchor_service.store import SiteStore
from dropanchor_tag_client.simulator.live import simulation
from support.browser import watched_page
from support.scripted_past import MODELS, Script, write_past
from support.service import Running, running_service

pytestmark = pytest.mark.browser
S = 1_000_000_000
TAGS, SEED = 5, 5
TURNED, JUMPED, SET, UNTOUCHED = "sim-1", "sim-2", "sim-3", "sim-5"
AT_S, MOVED_S, CORRECTED_S, END_S = 30.0, 60.0, 75.0, 80.0
AWAY_X = 8.0
MOST_CLICKS = 5
MOUNT, ANCHOR = "mount_angle_rad: null → 1.57", "x: 0 → 25"


def mount_otherwise(site: SiteStore) -> None:
    site.set_tag(SET, site.tag_settings(SET).model_copy(update={"mount_angle_rad": 1.57}))


def move_anchor(site: SiteStore) -> None:
    site.set_anchor(Anchor(id="1", x=25.0))


@pytest.fixture(scope="module")
def t0_ns() -> int:
    """The past begins an hour ago."""
    return (time.time_ns() - 3600 * S) // S * S


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory, t0_ns: int) -> Iterator[Running]:
    """A service whose tags went wrong: by a setting, a clock and a hand on a tag, then by the anchor and its place."""
    folder = tmp_path_factory.mktemp("then")
    changes = {AT_S: mount_otherwise, CORRECTED_S: move_anchor}
    script = Script(TURNED, JUMPED, AT_S, AWAY_X, MOVED_S, changes)
    config = write_past(folder, TAGS, SEED, t0_ns, END_S, script)
    with running_service("--config", str(config), "--data-dir", str(folder / "data")) as service:
        yield service


class Person:
    """Somebody at the page, who clicks. clicks: how often."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.clicks = 0

    def click(self, where: str | Locator) -> None:
        (self.page.locator(where) if isinstance(where, str) else where).click()
        self.clicks += 1

    def go_to(self, tag: str, at_ns: int) -> None:
        self.click(f"tr[data-tag='{tag}']")
        self.click("#history")
        expect(self.page.locator("#then")).to_be_visible()
        slider = self.page.locator("#past [data-part=slider]")
        slider.fill("0")
        from_ms = self.page.evaluate("dropanchor.past().time_ms")
        slider.fill(str(round((at_ns / 1e6 - from_ms) / 1000)))
        self.clicks += 1

    def explain(self, cause: str) -> Locator:
        """Ask why, and return the line that says so."""
        self.click("#then [data-part=explain]")
        line = self.page.locator("#then [data-part=lines] li", has_text=cause)
        expect(line).to_have_count(1)
        assert self.clicks <= MOST_CLICKS
        return line

    def run_by(self, where: Locator) -> dict[str, Any]:
        """Click what runs the time again, and return the answer once the page has said it."""
        with self.page.expect_response(lambda answer: "/what-if" in answer.url) as found:
            self.click(where)
        run: dict[str, Any] = found.value.json()
        assert run["began_at_pose"]
        place = ", ".join(f"{run['what_if'][axis][-1]:.2f}".replace("-", "−") for axis in "xy")
        answer = self.page.locator("#then form [data-part=answer]")
        expect(answer).to_contain_text(f"it would have been at {place} m, {run['apart_m']:.2f} m from there")
        return run


@pytest.fixture
def person(chromium: Browser, service: Running) -> Iterator[Person]:
    with watched_page(chromium, f"{service.url}/") as watched:
        yield Person(watched.page)
        assert watched.errors == []


@pytest.mark.parametrize(("tag", "cause"), [(SET, MOUNT), (UNTOUCHED, ANCHOR)], ids=["mount", "anchor"])
def test_a_change_is_found_and_tried_without_and_taken_back_and_that_undone(
    service: Running, person: Person, t0_ns: int, tag: str, cause: str
) -> None:
    person.go_to(tag, t0_ns + round((END_S - 1) * S))
    line = person.page.locator("#then [data-part=changes] li", has_text=cause)
    expect(line).to_have_count(1)
    assert person.clicks <= MOST_CLICKS
    person.run_by(line.get_by_role("button", name="What if not"))
    before = settings_of(service)
    person.click("#then [data-part=apply]")
    person.click(person.page.locator("#outcome").get_by_role("button", name="Undo"))
    expect(person.page.locator("#outcome").get_by_role("button", name="Redo")).to_be_visible()
    assert settings_of(service) == before


def test_a_place_that_would_have_been_known_is_told_where_the_one_as_it_was_is_not(person: Person, t0_ns: int) -> None:
    known = {"t_ns": [t0_ns], "x": [1.0], "y": [2.0], "state": ["tracking"]}
    person.page.route("**/what-if", lambda route: route.fulfill(json={"apart_m": None, "what_if": known}))
    person.go_to(UNTOUCHED, t0_ns + round((END_S - 1) * S))
    line = person.page.locator("#then [data-part=changes] li", has_text=ANCHOR)
    person.click(line.get_by_role("button", name="What if not"))
    expect(person.page.locator("#then form [data-part=answer]")).to_contain_text("it would have been at 1.00, 2.00 m.")


def settings_of(service: Running) -> tuple[Any, Any]:
    return service.get(f"/api/v1/tags/{SET}/settings"), service.get("/api/v1/anchors/1")


def test_a_clock_that_jumped_is_named_and_the_samples_are_saved(person: Person, t0_ns: int) -> None:
    person.go_to(JUMPED, t0_ns + round((AT_S + 15) * S))
    person.explain("the clock of the tag was set")
    with person.page.expect_download() as download:
        person.click("#then [data-part=save]")
    assert Path(download.value.path()).read_bytes().startswith(b"\x89MCAP")


def test_a_tag_turned_on_its_vehicle_is_named_and_tried(person: Person, t0_ns: int) -> None:
    person.go_to(TURNED, t0_ns + round((MOVED_S - 4) * S))
    line = person.explain("The tag was turned on what carries it")
    expect(person.page.locator("#then [data-part=lines] button")).to_have_count(1)  # the anchor is not blamed
    run = person.run_by(line.get_by_role("button"))
    assert person.clicks <= MOST_CLICKS
    assert error_m(run["what_if"], TURNED, t0_ns) < 5.0 < error_m(run["as_was"], TURNED, t0_ns)


def test_an_anchor_that_was_carried_away_is_named_and_its_new_place_tried(person: Person, t0_ns: int) -> None:
    person.go_to(UNTOUCHED, t0_ns + round((CORRECTED_S - 1) * S))
    line = person.explain("Anchor 1 seems to have moved by")
    person.click(line.get_by_role("button"))
    form = person.page.locator("#then form")
    expect(form.locator("[name=x]")).to_be_focused()
    form.locator("[name=x]").fill(str(AWAY_X))
    run = person.run_by(form.get_by_role("button", name="Run it again"))
    assert error_m(run["what_if"], UNTOUCHED, t0_ns) < 2.0 < error_m(run["as_was"], UNTOUCHED, t0_ns)


def error_m(track: dict[str, list[Any]], tag: str, t0_ns: int) -> float:
    """Return how far the end of a track is from where the tag truly was."""
    truth = simulation("yard", SEED, int(tag[-1]) - 1, MODELS, END_S).truth
    place = int(truth.t_s.searchsorted((track["t_ns"][-1] - t0_ns) / S))
    return dist((track["x"][-1], track["y"][-1]), (truth.x[place], truth.y[place]))
