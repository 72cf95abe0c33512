"""Measure a month of 200 tags in a file and in a database: how fast it is written, and how long opening it takes."""

import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psycopg
import pytest

from benchmarks import report
from benchmarks.proc import cpu_s
from dropanchor_service.answers.columns import ellipse_95
from dropanchor_service.estimation.columns import POSE, Array, State
from dropanchor_service.history.heat_cells import CELL
from dropanchor_service.history.postgresql.database import Database
from dropanchor_service.history.postgresql.days import used_bytes
from dropanchor_service.history.sqlite.store import FILE_NAME
from dropanchor_service.history.storage import Retention
from dropanchor_service.history.summary_table import DAY, LENGTHS_NS, MAX_CELLS
from support.api import T_NS, ApiBench, make_api_bench
from support.history_places import DatabasePlace, FilePlace, Place, Writer, opened
from support.http_server import running_server
from support.postgresql import Postgresql, needs_postgresql, running_postgresql

pytestmark = pytest.mark.benchmark

TAGS = 200
DAY_S = 86_400
DAYS = 30
DENSE_S = 2 * 3600
SECOND = 1_000_000_000
MAX_OPEN_S = 1.0
RETENTION = Retention(SECOND, 0.1, 5 * SECOND, 10**18, 2**40)
NAMES = [f"tag-{number}" for number in range(TAGS)]
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


def read_stretches(level: int, stretch: int) -> bool:
    """Return whether the heat map of the month reads the stretch: days, and at both ends shorter ones."""
    from_ns, to_ns = stretch * LENGTHS_NS[level], (stretch + 1) * LENGTHS_NS[level]
    return level == DAY or from_ns < T_NS - (DAYS - 1) * DAY_S * SECOND or to_ns > T_NS - DAY_S * SECOND


def many_cells(count: int) -> Array:
    """Return so many cells of 2 m of each tag, on 100 m by 60 m."""
    random = np.random.default_rng(1)
    made = np.zeros(TAGS * count, CELL)
    made["tag"], made["size"], made["seconds"] = np.repeat(np.arange(TAGS) + 1, count), 2, random.uniform(1, 100)
    places = np.concatenate([random.permutation(50 * 30)[:count] for _ in range(TAGS)])
    made["x"], made["y"] = places // 30, places % 30
    return made


class Kept:
    """A history that the benchmark fills and reads, and its figures for the table."""

    def __init__(self, name: str, place: Place, bench: ApiBench) -> None:
        self.name = name
        self.place = place
        self.bench = bench
        self.figures: dict[str, str] = {}

    def fill(self) -> None:
        """Write the month and its summaries, and then as many cells as there may be in those that are read.

        That is as if every tag had been nearly everywhere on every day.
        """
        writer = self.place.writer()
        for poses in hours():
            insert(writer, poses)
            summarise(writer)
        writer.close()
        self.fill_heat()

    def fill_heat(self) -> None:
        raise NotImplementedError

    def cpu_s(self) -> float:
        """Return the processor time so far of all that takes part."""
        return time.process_time()

    def measure_writing(self) -> None:
        """Write poses of a year ago: as a service does every 2 s, and as it does after an hour without its database."""
        writer, begin = self.place.writer(), -400 * DAY_S
        for name, seconds, batches in (("400 at a time", 2, 25), ("40,000 at a time", 200, 3)):
            taken = []
            for _ in range(batches):
                poses = poses_at(np.arange(begin, begin + seconds))
                begin += seconds
                began = time.perf_counter()
                insert(writer, poses)
                taken.append(time.perf_counter() - began)
            self.figures[f"poses written in a second, {name}"] = f"{seconds * TAGS / float(np.median(taken)):,.0f}"
        writer.close()

    def measure_reading(self) -> None:
        ellipse_95(np.eye(2)[None])  # a service has loaded this kernel long before
        with running_server(self.bench.app(), self.bench.stopping) as port, httpx.Client(timeout=60) as client:
            for period, period_s in PERIODS_S.items():
                assert len(self.fastest(client, f"{period} of tracks", port, "tracks?", period_s)["tracks"]) == TAGS
            for period, period_s in PERIODS_S.items():
                assert self.fastest(client, f"{period} of a heat map", port, "heat-map?", period_s)["tags"] == TAGS
            one = self.fastest(client, "30 days of a heat map of a tag", port, "heat-map?tags=tag-7&", DAYS * DAY_S)
            assert one["tags"] == 1
            found = self.fastest(client, "an hour of a tag's poses", port, "tags/tag-7/track?limit=10000&", 3600)
            assert len(found["poses"]) >= 3600

    def fastest(self, client: httpx.Client, name: str, port: int, path: str, period_s: int) -> dict[str, Any]:
        """Request a period that ends with the newest pose a few times, note the times, and return the answer."""
        url = f"http://127.0.0.1:{port}/api/v1/{path}from={T_NS - period_s * SECOND}&to={T_NS}"
        taken, before_s = [], self.cpu_s()
        for _ in range(5):
            begun = time.perf_counter()
            response = client.get(url)
            taken.append(time.perf_counter() - begun)
            assert response.status_code == 200, response.text
        cost_s = (self.cpu_s() - before_s) / len(taken)
        self.figures[name] = f"{cost_s:.2f} ({min(taken):.2f} to {max(taken):.2f})"
        assert cost_s < MAX_OPEN_S  # other load on the machine slows requests, but hardly adds to this
        answer: dict[str, Any] = response.json()
        return answer


class InFile(Kept):
    def __init__(self, folder: Path) -> None:
        path = folder / FILE_NAME
        super().__init__("SQLite file", FilePlace(path), make_api_bench(folder=folder, retention=RETENTION))
        self.path = path

    def fill_heat(self) -> None:
        with sqlite3.connect(self.path) as file:
            for level, stretch in file.execute("SELECT level, stretch FROM heat WHERE level > 0").fetchall():
                if read_stretches(level, stretch):
                    cells = many_cells(MAX_CELLS[level]).tobytes()
                    file.execute("UPDATE heat SET cells = ? WHERE level = ? AND stretch = ?", (cells, level, stretch))
            ((poses,),) = file.execute("SELECT count(*) FROM poses")
        file.close()
        self.figures["bytes a pose, summaries included"] = f"{self.path.stat().st_size / poses:.0f}"


class InDatabase(Kept):
    def __init__(self, database: Database, server: Postgresql, url: str) -> None:
        bench = make_api_bench(retention=RETENTION, database=database)
        super().__init__("PostgreSQL", DatabasePlace(database, "default", RETENTION), bench)
        self.server, self.url = server, url

    def cpu_s(self) -> float:
        assert self.server.process is not None
        pid = self.server.process.pid
        backends = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return super().cpu_s() + sum(cpu_s(int(backend)) for backend in backends)

    def fill_heat(self) -> None:
        with psycopg.connect(self.url, options="-c search_path=dropanchor_history") as connection:
            for level, from_ns in connection.execute("SELECT level, from_ns FROM stretches WHERE level > 0").fetchall():
                if read_stretches(level, from_ns // LENGTHS_NS[level]):
                    values = (many_cells(MAX_CELLS[level]).tobytes(), level, from_ns)
                    connection.execute("UPDATE stretches SET cells = %s WHERE level = %s AND from_ns = %s", values)
            found = connection.execute("SELECT count(*) FROM poses").fetchone()
            assert found is not None
            self.figures["bytes a pose, summaries included"] = f"{used_bytes(connection) / found[0]:.0f}"


def insert(writer: Writer, poses: Array) -> None:
    writer.insert(poses, NAMES * (len(poses) // TAGS), ["1"] * len(poses))


def summarise(writer: Writer) -> None:
    for _ in range(2):  # the stretches of new poses rest after the first round
        while writer.summarise():
            pass


@needs_postgresql
def test_a_month_of_200_tags_opens_within_a_second_from_a_file_and_from_a_database(tmp_path: Path) -> None:
    with running_postgresql("fsync=on", "autovacuum=on", "shared_buffers=128MB") as server:
        url = server.new_database()
        with opened(url, T_NS) as database:
            both: list[Kept] = [InFile(tmp_path), InDatabase(database, server, url)]
            for kept in both:
                kept.fill()
                kept.measure_reading()
            for kept in both:
                kept.measure_writing()
    lines = [f"| {name} | {' | '.join(kept.figures[name] for kept in both)} |" for name in both[0].figures]
    lines.insert(0, "| **CPU-s of service, database and client (from question to answer, s)** | | |")
    report.record("history", "\n".join([f"| | {' | '.join(kept.name for kept in both)} |", "|---|---|---|", *lines]))
