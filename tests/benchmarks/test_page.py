"""Measure what the page costs the browser when every tag of a large site moves."""

from statistics import median

import numpy as np
import pytest

from benchmarks import report
from dropanchor_service.api.app import DASHBOARD
from service.dashboard.place import Place, live_api_bench
from support.browser import running_chromium, watched_page
from support.http_server import running_server

pytestmark = pytest.mark.benchmark

TAGS, FRAMES = 10_000, 40


def test_the_cost_of_ten_thousand_moving_tags_on_the_page() -> None:
    bench = live_api_bench()
    random = np.random.default_rng(1)
    names = [f"tag-{i}" for i in range(TAGS)]
    spent_ms: list[float] = []
    with running_server(bench.app(DASHBOARD), bench.stopping) as port, running_chromium() as chromium:
        place = Place(bench, f"http://127.0.0.1:{port}/")
        with watched_page(chromium, place.url) as page:
            for _ in range(FRAMES):
                place.move(*names, x=random.normal(0, 20, TAGS), y=random.normal(0, 20, TAGS))
                page.page.wait_for_timeout(250)
                spent_ms.append(page.page.evaluate("dropanchor.drawing().ms + dropanchor.streaming().ms"))
            visible = page.page.evaluate("dropanchor.drawing().visible")
    assert visible > TAGS / 2
    report.record(
        "page",
        f"{TAGS:,} tags that all move, {visible:,} of them on the map: {median(spent_ms):.0f} ms of JavaScript a frame "
        f"(median; the worst of {FRAMES} {max(spent_ms):.0f} ms), receiving and drawing, headless Chromium.",
    )
