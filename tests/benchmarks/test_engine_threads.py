"""Measure what more engine threads bring, without I/O, and which share of a batch stays on one of them."""

import os
import statistics
import time
from typing import Any

import numpy as np
import pytest

from benchmarks import report
from benchmarks.baselines import columns_of
from benchmarks.motion import MESSAGE_S, Track, tracks
from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_service.estimation.columns import ANCHOR
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.settings.engine_columns import tag_columns

pytestmark = pytest.mark.benchmark

TAGS = 2000
SETTLED, MESSAGES = 25, 40  # messages of each tag, of MESSAGE_S


class TimedEngine(FleetEngine):
    """An engine that adds up the time in which its threads share the work."""

    shared_s = 0.0

    def __init__(self, threads: int) -> None:
        super().__init__(threads=threads)
        run = self._lanes.run

        def timed(jobs: Any) -> Any:
            began_s = time.perf_counter()
            try:
                return run(jobs)
            finally:
                self.shared_s += time.perf_counter() - began_s

        self._lanes.run = timed  # type: ignore[method-assign]


def engine_of(threads: int, motions: list[Track]) -> TimedEngine:
    engine = TimedEngine(threads)
    engine.set_anchors(np.zeros(1, ANCHOR))
    for row in range(TAGS):
        x, y, heading = motions[row % len(motions)].start
        engine.configure(row, tag_columns(TagSettings(start=StartPose(x=x, y=y, heading_rad=heading)), 0.0))
    return engine


def test_the_cost_of_a_batch_by_the_number_of_threads() -> None:
    motions = tracks((SETTLED + MESSAGES + 1) * MESSAGE_S)
    cores = len(os.sched_getaffinity(0))
    engines = {threads: engine_of(threads, motions) for threads in dict.fromkeys((1, 2, cores))}
    walls: dict[int, list[float]] = {threads: [] for threads in engines}
    shares: dict[int, list[float]] = {threads: [] for threads in engines}
    for k in range(SETTLED + MESSAGES):
        batch = columns_of(motions, TAGS, k)
        for threads, engine in engines.items():
            engine.shared_s, began_s = 0.0, time.perf_counter()
            engine.process(batch)
            wall_s = time.perf_counter() - began_s
            if k >= SETTLED:
                walls[threads].append(wall_s)
                shares[threads].append(1.0 - engine.shared_s / wall_s)
    lines = ["| threads | ms for a batch | speed beside one thread | outside of the threads |", "|---|---|---|---|"]
    alone = statistics.median(walls[1])
    for threads, found in walls.items():
        wall, outside = statistics.median(found), statistics.median(shares[threads])
        lines.append(f"| {threads} | {wall * 1e3:.0f} | {alone / wall:.2f} | {100 * outside:.0f} % |")
    serial = statistics.median(shares[1])
    reach = ", ".join(f"{1 / (serial + (1 - serial) / cores):.1f} with {cores}" for cores in (4, 8, 16))
    report.record(
        "threads",
        "\n".join(lines) + f"\n\n{TAGS} tags, {cores} cores. By Amdahl's law the speed would be {reach} cores. The "
        "service receives, decodes and answers besides.",
    )
