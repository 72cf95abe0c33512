"""From the page alone: why a tag was wrong at a time that is past, and where it would have been otherwise."""

import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from support.browser import running_chromium, watched_page
from support.live_tags import LiveTags, is_current, poses_of
from support.service import Running, running_service
from support.zenoh_router import free_endpoint, router_process, wait_until

pytestmark = pytest.mark.browser
S = 1_000_000_000
TURNED, JUMPED, UNTOUCHED = "sim-1", "sim-2", "sim-3"
MOST_CLICKS = 5
MOUNT, ANCHOR = "mount_angle_rad: null → 1.57", "x: 0 → 25"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with running_chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A service whose tags have gone wrong: a mounting angle changes, a clock jumps, then the anchor moves."""
    folder, endpoint = tmp_path_factory.mktemp("then"), free_endpoint()
    tags = LiveTags(endpoint, 3, 5)
    config = tags.write_settings(folder)
    options = ("--config", str(config), "--data-dir", str(folder / "data"), "--zenoh-connect", endpoint)
    with ExitStack() as stack:
        stack.enter_context(router_process(endpoint))
        service = stack.enter_context(running_service(*options))
        stack.enter_context(tags)  # whose starts are known, so that the service must not miss the first metres

        def go_on(seconds: int) -> None:
            then_ns = time.time_ns() + seconds * S
            wait_until(lambda: min(pose["t_ns"] for pose in poses_of(service).values()) > then_ns)

        wait_until(lambda: is_current(service, 3))
        go_on(4)
        path = f"/api/v1/tags/{TURNED}/settings"
        service.put(path, service.get(path) | {"mount_angle_rad": 1.57})
        tags.clock_ns[JUMPED] = -60 * S
        go_on(6)
        service.put("/api/v1/anchors/1", {"id": "1", "x": 25.0})
        go_on(3)
        tags.finish()
        yield service


class Person:
    """Somebody at the page, who clicks. clicks: how often."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.clicks = 0

    def click(self, where: str | Locator) -> None:
        (self.page.locator(where) if isinstance(where, str) else where).click()
        self.clicks += 1

    def go_to_the_end_of_the_past(self, tag: str) -> None:
        self.click(f"tr[data-tag='{tag}']")
        self.click("#history")
        expect(self.page.locator("#then")).to_be_visible()
        self.page.locator("#past [data-part=slider]").press("End")


@pytest.fixture
def person(chromium: Browser, service: Running) -> Iterator[Person]:
    with watched_page(chromium, f"{service.url}/") as watched:
        yield Person(watched.page)
        assert watched.errors == []


@pytest.mark.parametrize(("tag", "cause"), [(TURNED, MOUNT), (UNTOUCHED, ANCHOR)], ids=["mount", "anchor"])
def test_a_change_is_found_and_tried_without_and_taken_back_and_that_undone(
    service: Running, person: Person, tag: str, cause: str
) -> None:
    person.go_to_the_end_of_the_past(tag)
    line = person.page.locator("#then [data-part=changes] li", has_text=cause)
    expect(line).to_have_count(1)
    assert person.clicks <= MOST_CLICKS
    with person.page.expect_response(lambda answer: "/what-if" in answer.url) as found:
        person.click(line.get_by_role("button", name="What if not"))
    run = found.value.json()
    assert run["began_at_pose"]
    place = ", ".join(f"{run['what_if'][axis][-1]:.2f}".replace("-", "−") for axis in "xy")
    answer = person.page.locator("#then form [data-part=answer]")
    expect(answer).to_contain_text(f"it would have been at {place} m, {run['apart_m']:.2f} m from there")
    before = settings_of(service)
    person.click("#then [data-part=apply]")
    person.click(person.page.locator("#outcome").get_by_role("button", name="Undo"))
    expect(person.page.locator("#outcome").get_by_role("button", name="Redo")).to_be_visible()
    assert settings_of(service) == before


def settings_of(service: Running) -> tuple[Any, Any]:
    return service.get(f"/api/v1/tags/{TURNED}/settings"), service.get("/api/v1/anchors/1")


def test_a_clock_that_jumped_is_named_the_samples_are_saved_and_typed_settings_are_tried(person: Person) -> None:
    person.go_to_the_end_of_the_past(JUMPED)
    person.click("#then [data-part=explain]")
    expect(person.page.locator("#then li", has_text="the clock of the tag was set")).to_have_count(1)
    assert person.clicks <= MOST_CLICKS
    with person.page.expect_download() as download:
        person.click("#then [data-part=save]")
    assert Path(download.value.path()).read_bytes().startswith(b"\x89MCAP")
    form = person.page.locator("#then form")
    form.locator("[name=motion]").select_option("carried")
    form.locator("[name=anchor]").select_option("1")
    form.locator("[name=x]").fill("3.5")
    form.locator("[name=minutes]").fill("0.1")
    person.click(form.get_by_role("button", name="Run it again"))
    expect(form.locator("[data-part=answer]")).to_contain_text("With motion = carried, 1: 3.50,")
