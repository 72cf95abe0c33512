"""Run a row: all its tags are rows of one engine, which gets their samples in batches."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_evaluation.product.rows import Row
from dropanchor_evaluation.product.runs import TagRun, sources, tag_run
from dropanchor_evaluation.product.scores import RowScore, TagScore, score, summary
from dropanchor_evaluation.simulated import batches, merged
from dropanchor_service.engines.warm_up import warm_up
from dropanchor_service.estimation.columns import POSE, Array, SampleBatch
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.protocols import Engine
from dropanchor_service.offline.replay import NS_PER_S, Track

BATCH_S = 0.05
ROWS_PER_TASK = 6


@dataclass(frozen=True)
class Task:
    """Rows that share their runs."""

    rows: tuple[Row, ...]
    seeds: range


@dataclass(frozen=True)
class Result:
    row: Row
    score: RowScore
    tags: list[TagScore]


def tasks(rows: Sequence[Row], seeds: range) -> list[Task]:
    """Group consecutive rows that share their runs into tasks, at most ROWS_PER_TASK each."""
    found: list[Task] = []
    for row in rows:
        last = found[-1].rows if found else ()
        if last and last[0].runs_of == row.runs_of and len(last) < ROWS_PER_TASK:
            found[-1] = Task((*last, row), seeds)
        else:
            found.append(Task((row,), seeds))
    return found


def prepare() -> None:
    """Compile or load the kernels, so that no row includes that time."""
    warm_up(FleetEngine())


def work(task: Task) -> list[Result]:
    """Run the rows of a task. Raises RecordingError."""
    prepare()
    runs = sources(task.rows[0], task.seeds)
    return [run_row(row, [tag_run(row, one) for one in runs]) for row in task.rows]


def run_row(row: Row, runs: Sequence[TagRun]) -> Result:
    """Run all tags of a row through one engine."""
    tags, seconds = score_tags(FleetEngine(), runs)
    return Result(row, summary(tags, 1e6 * seconds / sum(_duration(run) for run in runs)), tags)


def score_tags(engine: Engine, runs: Sequence[TagRun]) -> tuple[list[TagScore], float]:
    """Return the scores of all tags in a fresh engine, and its processor time, s."""
    tracks, seconds = run_tags(engine, runs)
    tags = [
        score(run.name, track, run.truth, (float(run.anchors["x"][0]), float(run.anchors["y"][0])), run.no_north)
        for run, track in zip(runs, tracks, strict=True)
    ]
    return tags, seconds


def run_tags(engine: Engine, runs: Sequence[TagRun]) -> tuple[list[Track], float]:
    """Run a fresh engine on all tags, run i as row i. Return their tracks and the engine's processor time, s."""
    engine.set_anchors(np.concatenate([run.anchors for run in runs]))
    for row, run in enumerate(runs):
        engine.configure(row, run.settings)
    steps, seconds = [np.empty(0, POSE)], 0.0
    for batch in batches(_together(runs), BATCH_S):
        started = time.process_time()
        steps.append(engine.process(batch).poses)
        seconds += time.process_time() - started
    poses = np.concatenate(steps)
    return [_track(poses[poses["row"] == row]) for row in range(len(runs))], seconds


def _track(poses: Array) -> Track:
    return Track(poses["t_ns"] / NS_PER_S, poses)


def _together(runs: Sequence[TagRun]) -> SampleBatch:
    """Return the samples of all tags. Each tag has its own anchors, so no tag can learn from another."""
    parts, anchors = [], 0
    for row, run in enumerate(runs):
        sent = run.samples
        imu, ranges, headings, pressures = (
            kind.copy() for kind in (sent.imu, sent.ranges, sent.headings, sent.pressures)
        )
        for kind in (imu, ranges, headings, pressures):
            kind["row"] = row
        ranges["anchor"] += anchors
        anchors += len(run.anchors)
        parts.append(SampleBatch(imu=imu, ranges=ranges, headings=headings, pressures=pressures))
    return merged(parts)


def _duration(run: TagRun) -> float:
    return float(run.samples.ranges["t_ns"][-1]) / NS_PER_S
