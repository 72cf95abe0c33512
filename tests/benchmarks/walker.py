"""What an operator does on the page, counted: clicks, keys, scrolls and seconds."""

import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

from playwright.sync_api import Error, FilePayload, Locator, Page

ACTION_MS, SEEN_S = 1000, 2.0
_IN_VIEW = """(element) => new Promise((done) =>
    new IntersectionObserver(([entry]) => done(entry.intersectionRatio > 0.5)).observe(element))"""


Place = tuple[float, float]
"""Pixels on the map, from its top left corner."""
Role = Literal["button", "menuitem", "gridcell", "option"]
Key = Literal["Control", "Shift"]


class NotSeenError(Exception):
    """What a step should have brought about did not happen in time."""


@dataclass
class Walker:
    """A person before the page. Every press counts once; a typed text counts as its letters."""

    page: Page
    clicks: int = 0
    keys: int = 0
    scrolls: int = 0
    begun_s: float = field(default_factory=time.monotonic)

    @property
    def map(self) -> Locator:
        return self.page.get_by_role("application").first

    def button(self, name: str, role: Role = "button") -> Locator:
        """Return the last visible element of this role whose name matches. name: regular expression."""
        return self.page.get_by_role(role, name=re.compile(name)).locator("visible=true").last

    def field(self, label: str, within: Locator | None = None) -> Locator:
        return (within or self.page).get_by_label(re.compile(label)).locator("visible=true").last

    def click(self, target: Locator, *held: Key, button: Literal["left", "right"] = "left") -> None:
        """Click, with keys held down, each of which counts."""
        self._reach(target)
        self.clicks += 1
        self.keys += len(held)
        target.click(modifiers=held, button=button, timeout=ACTION_MS)

    def click_map(self, place: Place, button: Literal["left", "right"] = "left") -> None:
        self.clicks += 1
        self.map.click(position={"x": place[0], "y": place[1]}, button=button, timeout=ACTION_MS)

    def ask(self, place: Place, item: str) -> None:
        """Right-click a place of the map and choose an item of the menu."""
        self.click_map(place, "right")
        self.click(self.button(item, "menuitem"))

    def drag(self, start: Place, end: Place) -> None:
        """Drag something on the map, which counts as one click."""
        box = self.map.bounding_box(timeout=ACTION_MS) or {"x": 0, "y": 0}
        mouse = self.page.mouse
        self.clicks += 1
        mouse.move(box["x"] + start[0], box["y"] + start[1])
        mouse.down()
        mouse.move(box["x"] + end[0], box["y"] + end[1], steps=3)
        mouse.up()

    def write(self, target: Locator, text: str) -> None:
        """Click a field and type a text in place of what it holds."""
        self.click(target)
        self.keys += len(text)
        target.fill(text, timeout=ACTION_MS)

    def press(self, *keys: str) -> None:
        self.keys += len(keys)
        for key in keys:
            self.page.keyboard.press(key)

    def type(self, text: str) -> None:
        self.keys += len(text)
        self.page.keyboard.type(text)

    def choose_file(self, target: Locator, content: bytes) -> None:
        """Choose a file: a click on the field and one in the dialog."""
        self.clicks += 2
        target.set_input_files(
            FilePayload(name="halle.svg", mimeType="image/svg+xml", buffer=content), timeout=ACTION_MS
        )

    def see(self, happened: Callable[[], object], within_s: float = SEEN_S) -> None:
        """Wait until something is there. Raises NotSeenError."""
        end_s = time.monotonic() + within_s
        while not happened():
            if time.monotonic() > end_s:
                raise NotSeenError
            self.page.wait_for_timeout(25)

    def _reach(self, target: Locator) -> None:
        """Scroll to what is out of view, as a person has to."""
        target.wait_for(state="visible", timeout=ACTION_MS)
        if not target.evaluate(_IN_VIEW, timeout=ACTION_MS):
            self.scrolls += 1
            target.scroll_into_view_if_needed(timeout=ACTION_MS)

    def __str__(self) -> str:
        scrolls = f" + {self.scrolls}" if self.scrolls else ""
        return f"{self.clicks} + {self.keys}{scrolls}, {time.monotonic() - self.begun_s:.1f} s"


Way = Callable[[Walker], None]


def walked(page: Page, ways: Sequence[Way], begin: Callable[[], None], works: set[str]) -> str:
    """Try the ways to do a task, each on a page of its own, and return the count of the first that works.

    works: names of ways that worked with fewer tags, which are tried first. The one that works is added.
    """
    for way in sorted(ways, key=lambda way: way.__name__ not in works):
        begin()
        walker = Walker(page)
        try:
            way(walker)
        except (Error, NotSeenError):
            continue
        works.add(way.__name__)
        return str(walker)
    return "not possible"
