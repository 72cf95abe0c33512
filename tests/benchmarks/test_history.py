"""Measure how long it takes to open a month of 200 tags, from the file to the response."""

import os
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from dropanchor_service.answers.columns import ellipse_95
from dropanchor_service.estimation.columns import POSE, Array, State
from dropanchor_service.history.heat_cells import CELL
from dropanchor_service.history.sqlite.store import FILE_NAME
from dropanchor_service.history.sqlite.track_file import TrackWriter
from dropanchor_service.history.storage import Retention
from dropanchor_service.history.summary_table import DAY, LENGTHS_NS, MAX_CELLS
from support.api import T_NS, ApiBench, make_api_bench
from support.http_server import running_server

pytestmark = pytest.mark.benchmark

TAGS = 200
DAY_S = 86_400
DAYS = 30
DENSE_S = 2 * 3600
SECOND = 1_000_000_000
MAX_OPEN_S = 1.0
PERIODS_S = {"30 days": DAYS * DAY_S, "1 day": DAY_S, "1 hour": 3600, "10 minutes": 600}


def poses_at(seconds: Array) -> Array:
    """Return a pose of each tag for each of these seconds after the start, in order of time."""
    phase = seconds[:, None] / 300 + np.arange(TAGS)
    made = np.zeros(len(seconds) * TAGS, POSE)
    made["t_ns"] = T_NS - DAYS * DAY_S * SECOND + np.repeat(seconds, TAGS) * SECOND
    made["x"], made["y"] = (50 * np.cos(phase)).ravel(), (30 * np.sin(phase)).ravel()
    made["speed"], made["state"] = 0.2, State.TRACKING
    made["cov"] = np.diag([0.04, 0.01, 0.001])
    return made


def hours() -> Iterator[Array]:
    """Yield poses hour by hour: one per tag and two minutes, and in the last two hours one per second.

    A summary is as large with one pose as with 120, so the month costs as much as one with a pose per second.
    """
    for begin in range(0, DAYS * DAY_S, 3600):
        step = 1 if begin >= DAYS * DAY_S - DENSE_S else 120
        yield poses_at(np.arange(begin, begin + 3600, step))


def fill_heat(path: Path) -> None:
    """Write as many cells as there may be: as if every tag had been nearly everywhere on every day."""
    with sqlite3.connect(path) as file:
        for level, stretch in file.execute("SELECT level, stretch FROM heat WHERE level > 0").fetchall():
            from_ns, to_ns = stretch * LENGTHS_NS[level], (stretch + 1) * LENGTHS_NS[level]
            is_read = level == DAY or from_ns < T_NS - (DAYS - 1) * DAY_S * SECOND or to_ns > T_NS - DAY_S * SECOND
            if is_read:
                cells = many_cells(MAX_CELLS[level]).tobytes()
                file.execute("UPDATE heat SET cells = ? WHERE level = ? AND stretch = ?", (cells, level, stretch))
    file.close()


def many_cells(count: int) -> Array:
    """Return so many cells of 2 m of each tag, on 100 m by 60 m."""
    random = np.random.default_rng(1)
    made = np.zeros(TAGS * count, CELL)
    made["tag"], made["size"], made["seconds"] = np.repeat(np.arange(TAGS) + 1, count), 2, random.uniform(1, 100)
    places = np.concatenate([random.permutation(50 * 30)[:count] for _ in range(TAGS)])
    made["x"], made["y"] = places // 30, places % 30
    return made


@pytest.fixture(scope="module")
def month(tmp_path_factory: pytest.TempPathFactory) -> ApiBench:
    folder: Path = tmp_path_factory.mktemp("month")
    writer = TrackWriter(folder / FILE_NAME)
    names = [f"tag-{number}" for number in range(TAGS)]
    for poses in hours():
        count = len(poses) // TAGS
        writer.insert(poses, names * count, ["1"] * len(poses))
        for _ in range(2):  # the stretches of these poses rest after the first round
            while writer.summarise():
                pass
    writer.close()
    fill_heat(folder / FILE_NAME)
    return make_api_bench(folder=folder, retention=Retention(SECOND, 0.1, 5 * SECOND, 10**18, 2**40))


def test_a_month_of_200_tags_opens_within_a_second(month: ApiBench) -> None:
    ellipse_95(np.eye(2)[None])  # a service has loaded this kernel long before
    with running_server(month.app(), month.stopping) as port, httpx.Client(timeout=60) as client:
        for name, period_s in PERIODS_S.items():
            tracks = fastest(client, f"{name} of tracks", port, "tracks?", period_s)["tracks"]
            assert len(tracks) == TAGS


def test_a_heat_map_of_a_month_of_200_tags_takes_less_than_a_second(month: ApiBench) -> None:
    with running_server(month.app(), month.stopping) as port, httpx.Client(timeout=60) as client:
        for name, period_s in PERIODS_S.items():
            found = fastest(client, f"{name} of a heat map", port, "heat-map?", period_s)
            assert found["tags"] == TAGS
            one = fastest(client, f"{name} of a heat map of a tag", port, "heat-map?tags=tag-7&", period_s)
            assert one["tags"] == 1


def fastest(client: httpx.Client, name: str, port: int, path: str, period_s: int) -> dict[str, Any]:
    """Request a period that ends with the newest pose a few times, print the times, and return the answer."""
    url = f"http://127.0.0.1:{port}/api/v1/{path}from={T_NS - period_s * SECOND}&to={T_NS}"
    taken, cpu_s = [], time.process_time()
    for _ in range(5):
        begun = time.perf_counter()
        response = client.get(url)
        taken.append(time.perf_counter() - begun)
        assert response.status_code == 200, response.text
    cpu_s = (time.process_time() - cpu_s) / len(taken)
    print(
        f"\n{name}: {min(taken):.2f} to {max(taken):.2f} s, {cpu_s:.2f} s CPU with the client, "
        f"{len(response.content) / 1e6:.1f} MB, load {os.getloadavg()[0]:.1f}"
    )
    assert min(taken) < MAX_OPEN_S  # other load on the machine slows single requests
    answer: dict[str, Any] = response.json()
    return answer
