"""With many tags the map stays legible, and says what lies beside it."""

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from dropanchor_service.estimation.columns import Frame
from service.dashboard.place import Place
from support.browser import WatchedPage, watched_page

pytestmark = pytest.mark.browser

WIDE_M = 2.4477 * 20
IN_VIEW = """(({ clientWidth, clientHeight }) => dropanchor.tags()
    .filter(({ pixel: [x, y] }) => x >= 0 && y >= 0 && x <= clientWidth && y <= clientHeight)
    .length)(document.getElementById("map"))"""
BESIDE = """[...document.querySelectorAll("#edges button:not([hidden])")]
    .reduce((sum, { textContent }) => sum + Number(textContent), 0)"""


def overlap(a: list[float], b: list[float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def around(pixel: list[float], reach: float) -> list[float]:
    return [pixel[0] - reach, pixel[1] - reach, pixel[0] + reach, pixel[1] + reach]


def count_circles(page: Page) -> None:
    """Count the circles that the page draws, in `circles`."""
    page.add_init_script(
        "const arc = CanvasRenderingContext2D.prototype.arc; window.circles = 0;"
        "CanvasRenderingContext2D.prototype.arc = function (...place) { circles++; return arc.apply(this, place); };"
    )


def check_stamps(page: WatchedPage, place: Place) -> None:
    """A drawing of many tags stamps its dots, each where its tag is, and draws a circle for few of them."""
    x, y = (values.ravel() for values in np.meshgrid(np.linspace(-13.0, 13, 40), np.linspace(-13.0, 13, 40)))
    crowd = [f"crowd-{number}" for number in range(len(x))]
    for moved in (0.0, 0.2):
        page.page.evaluate("window.circles = 0; window.before = dropanchor.drawing().drawings")
        place.move(*crowd, x=x + moved, y=y, heading=np.linspace(-3.1, 3.1, len(x)))
        page.wait_for(f"dropanchor.tags().find(({{ tag }}) => tag === '{crowd[0]}')?.x > {x[0] + moved - 0.01}")
        page.wait_for(f"dropanchor.drawing().still && dropanchor.drawing().visible >= {len(x)}")
    assert page.page.evaluate("circles / (dropanchor.drawing().drawings - before + 1)") < len(x) / 4
    known = page.tags()
    seen = page.pixels([known[name]["pixel"] for name in crowd[::97]])
    assert sum(pixel[:3] == pytest.approx((0x00, 0x67, 0xB8), abs=12) for pixel in seen) > 0.8 * len(seen)


def test_names_and_ellipses_of_a_crowd_have_room_and_tags_beside_the_map_are_counted(
    chromium: Browser, place: Place
) -> None:
    x, y = (values.ravel() for values in np.meshgrid(np.arange(-14.0, 15, 4), np.arange(-14.0, 15, 4)))
    names = [f"forklift-{number}" for number in range(len(x))]
    place.move(*names, x=x, y=y)
    place.move("rough", x=0.0, y=5.0, cov=np.diag([400.0, 1.0, 0.001]))
    place.move("turned", x=1.0, y=1.0, frame=Frame.RELATIVE)
    with watched_page(chromium, place.url, size=(1440, 900), locale="de-DE", prepare=count_circles) as page:
        page.wait_for_map(len(x) + 2)
        left, right = (page.page.evaluate(f"dropanchor.screen({edge}, 5)[0]") for edge in (-WIDE_M, WIDE_M))
        assert left > 0
        assert right < page.page.evaluate("document.getElementById('tools').offsetLeft")
        labels = page.page.evaluate("dropanchor.drawing().labels")
        (anchor,) = page.page.evaluate("dropanchor.anchors()")
        blocked = [around(tag["pixel"], 5) for tag in page.tags().values()] + [around(anchor["pixel"], 11)]
        assert len(labels) > 10
        for number, label in enumerate(labels):
            assert not any(overlap(label, other) for other in blocked + labels[:number]), label
        cut = (
            "[...document.querySelectorAll('td.c-state')].filter((cell) => cell.scrollWidth > cell.clientWidth).length"
        )
        page.page.locator("#filter").fill("turned")
        expect(page.page.locator("tr[data-tag='turned'] td.c-state")).to_be_visible()
        assert page.page.evaluate(cut) == 0
        page.page.locator("#filter").fill("rough")
        page.page.locator("tr[data-tag='rough']").click()
        page.page.locator("#filter").fill("")
        accuracy = page.page.locator("[data-part='v-accuracy']")
        expect(accuracy).to_have_text("± 49,0 m längs, ± 2,45 m quer")
        hints = page.page.locator("#edges button:visible")
        expect(hints).to_have_count(0)
        for _ in range(5):
            page.page.locator("#zoom-in").click()
        expect(hints).to_have_count(4)
        page.wait_for("dropanchor.drawing().still")
        page.wait_for(f"{BESIDE} + {IN_VIEW} === {len(x) + 2}")  # they are counted a few times a second
        expect(hints.first).to_have_attribute(
            "aria-label", f"{hints.first.inner_text()} Tags links außerhalb des Bilds: zeigen"
        )
        while hints.count() > 0:
            hints.first.click()
            page.wait_for("dropanchor.drawing().still")
            page.wait_for(f"{BESIDE} + {IN_VIEW} === {len(x) + 2}")
        assert page.page.evaluate(IN_VIEW) == len(x) + 2
        check_stamps(page, place)
        assert page.errors == []
