"""Measure what the page costs the browser when every tag of a large site moves, now and in the past."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from statistics import quantiles

import numpy as np
import pytest
from playwright.sync_api import Browser

from benchmarks import report
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.estimation.columns import POSE, Array, State
from dropanchor_service.history.sqlite.store import FILE_NAME
from dropanchor_service.history.sqlite.track_file import TrackWriter
from dropanchor_service.history.storage import Retention
from service.dashboard.place import Place, live_api_bench
from support.browser import WatchedPage, running_chromium, watched_page
from support.http_server import running_server

pytestmark = pytest.mark.benchmark

TAGS, FEW_TAGS = 10_000, 100
SECOND = 1_000_000_000
PAST_S, MEASURED_S = 240, 12
FIRST_S = 60
RETENTION = Retention(SECOND, 0.1, 5 * SECOND, 10**18, 2**40)
CATEGORIES = ["disabled-by-default-devtools.timeline", "__metadata"]


@dataclass(frozen=True)
class Frames:
    """What the main thread of the page did: the time of its tasks in ms, the drawings of the map, the past in s."""

    tasks_ms: list[float]
    drawings: int
    past_s: float

    def __str__(self) -> str:
        each = sum(self.tasks_ms) / max(1, self.drawings)
        worst, p99 = max(self.tasks_ms), quantiles([ms for ms in self.tasks_ms if ms > 1], n=100)[98]
        return f"{each:.0f} | {p99:.0f} | {worst:.0f} | {self.drawings / MEASURED_S:.1f}"


def test_the_cost_of_ten_thousand_moving_tags_on_the_page(tmp_path: Path) -> None:
    lines = []
    with running_chromium() as chromium:
        for tags in (FEW_TAGS, TAGS):
            with served(tmp_path / str(tags), tags) as (place, end_ns):
                lines.append(f"| {tags:,}, live | {live(chromium, place, tags)} | |")
                for speed in (1, 10):
                    found = replayed(chromium, place, end_ns, tags, speed)
                    lines.append(f"| {tags:,}, the past × {speed} | {found} | {found.past_s / MEASURED_S:.1f} |")
    head = "| tags | ms per frame | p99 of tasks ms | longest task ms | frames/s | seconds of past per second |"
    report.record(
        "page",
        f"The processor time of the page's main thread in {MEASURED_S} s while all tags move: all of it by the frames "
        "of the map, and its longest tasks; headless Chromium without a graphics card."
        f"\n\n{head}\n|---|---|---|---|---|---|\n" + "\n".join(lines),
    )


@contextmanager
def served(folder: Path, tags: int) -> Iterator[tuple[Place, int]]:
    """A page whose service has stored some minutes of poses until an hour ago, and the end of that past in ns."""
    end_ns = (time.time_ns() // SECOND - 3600) * SECOND
    write_past(folder, tags, end_ns)
    bench = live_api_bench(folder=folder, retention=RETENTION)
    with running_server(bench.app(DASHBOARD), bench.stopping) as port:
        yield Place(bench, f"http://127.0.0.1:{port}/"), end_ns


def write_past(folder: Path, tags: int, end_ns: int) -> None:
    """Store a pose per second of tags that drive in circles."""
    folder.mkdir()
    writer = TrackWriter(folder / FILE_NAME)
    names = [f"tag-{number}" for number in range(tags)]
    for second in range(PAST_S):
        writer.insert(circles(tags, second, end_ns - (PAST_S - second) * SECOND), names, [None] * tags)
    for _ in range(2):
        while writer.summarise():
            pass
    writer.close()


def circles(tags: int, second: float, t_ns: int) -> Array:
    random = np.random.default_rng(1)
    phase = second / 20 + random.uniform(0, 2 * np.pi, tags)
    made = np.zeros(tags, POSE)
    made["t_ns"], made["speed"], made["state"] = t_ns, 0.5, State.TRACKING
    made["x"] = random.normal(0, 20, tags) + 10 * np.cos(phase)
    made["y"] = random.normal(0, 20, tags) + 10 * np.sin(phase)
    made["cov"] = np.diag([0.04, 0.01, 0.001])
    return made


def live(chromium: Browser, place: Place, tags: int) -> Frames:
    names = [f"tag-{number}" for number in range(tags)]
    begun_s = time.monotonic()
    with watched_page(chromium, place.url, reduced_motion="no-preference") as page:

        def move() -> None:
            made = circles(tags, time.monotonic() - begun_s, 0)
            place.move(*names, x=made["x"], y=made["y"], speed=made["speed"])
            page.page.wait_for_timeout(100)

        for _ in range(20):
            move()
        return frames(chromium, page, move)


def replayed(chromium: Browser, place: Place, end_ns: int, tags: int, speed: int) -> Frames:
    """Play the past, after the first pieces have arrived."""
    start_ns = end_ns - PAST_S * SECOND
    values = {"from": iso(start_ns), "to": iso(end_ns), "at": iso(start_ns + FIRST_S * SECOND), "speed": str(speed)}
    link = f"{place.url}#" + "&".join(f"{name}={value}" for name, value in values.items())
    with watched_page(chromium, link, reduced_motion="no-preference") as page:
        page.wait_for(f"dropanchor.past() && !dropanchor.past().loading && dropanchor.tags().length === {tags}", 90)
        page.page.locator("[data-part='play']").click()
        page.page.wait_for_timeout(1000)
        return frames(chromium, page, lambda: page.page.wait_for_timeout(500))


def frames(chromium: Browser, page: WatchedPage, step: Callable[[], None]) -> Frames:
    """Trace the main thread of the page while `step` is repeated."""
    read = "[dropanchor.drawing().drawings, (dropanchor.past() || {time_ms: 0}).time_ms]"
    drawn, past_ms = page.page.evaluate(read)
    chromium.start_tracing(page=page.page, categories=CATEGORIES)
    end_s = time.monotonic() + MEASURED_S
    while time.monotonic() < end_s:
        step()
    tasks = main_thread_tasks(json.loads(chromium.stop_tracing())["traceEvents"])
    drawn_then, past_then_ms = page.page.evaluate(read)
    return Frames(tasks, drawn_then - drawn, (past_then_ms - past_ms) / 1000)


def main_thread_tasks(events: list[dict[str, object]]) -> list[float]:
    """Return the processor time of each task of the busiest main thread of a page, ms."""
    threads: dict[tuple[object, object], list[float]] = {
        (event["pid"], event["tid"]): []
        for event in events
        if event["name"] == "thread_name" and "CrRendererMain" in str(event["args"])
    }
    for event in events:
        thread = (event["pid"], event["tid"])
        if event["name"] == "RunTask" and thread in threads and "tdur" in event:  # else it runs on beyond the trace
            threads[thread].append(float(str(event["tdur"])) / 1000)
    return max(threads.values(), key=sum)


def iso(t_ns: int) -> str:
    return datetime.fromtimestamp(t_ns / SECOND, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
