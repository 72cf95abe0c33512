"""Measure what estimation costs without I/O: the engines and a plain filterpy EKF per tag, in one run.

A tag sends 100 Hz of raw 9-axis IMU samples and 10 Hz of ranges in 5 messages per second, and its start is known. The
plain filter does the minimum: for each range one prediction, one heading and one range update, and no attitude.
"""

import math
import statistics
import time
from collections.abc import Iterator

import numpy as np
import pytest

from benchmarks import report
from dropanchor_service.estimation.columns import (
    ANCHOR,
    IMU,
    RANGE,
    Array,
    HeadingSource,
    SampleBatch,
    State,
    default_settings,
)
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.paper.ekf import PoseFilter
from dropanchor_service.estimation.paper.engine import PaperEngine
from dropanchor_service.estimation.paper.parameters import TUNED
from dropanchor_service.estimation.plausibility.check import SensorCheck
from dropanchor_service.estimation.protocols import Engine
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate

pytestmark = pytest.mark.benchmark

RUNS, COPIES = 8, 50
MESSAGE_S, SETTLED_S, END_S = 0.2, 10.0, 25.0
IDLE = 10_000


def imu_of(run: Simulation, row: int) -> Array:
    columns = np.zeros(len(run.imu.t_s), IMU)
    columns["row"], columns["t_ns"] = row, np.rint(run.imu.t_s * 1e9)
    columns["acc"], columns["gyro"], columns["mag"] = run.imu.acc, run.imu.gyro, run.imu.mag
    return columns


def ranges_of(run: Simulation, row: int) -> Array:
    columns = np.zeros(len(run.ranges.t_s), RANGE)
    columns["row"], columns["t_ns"] = row, np.rint(run.ranges.t_s * 1e9)
    columns["range"], columns["std"] = run.ranges.range_m, run.ranges.std_m
    return columns


def messages(columns: list[Array], k: int) -> Array:
    """Return the samples of message k of every tag, one tag after the other."""
    start, end = round(k * MESSAGE_S * 1e9), round((k + 1) * MESSAGE_S * 1e9)
    return np.concatenate([c[(c["t_ns"] >= start) & (c["t_ns"] < end)] for c in columns])


def batches(runs: list[Simulation], copies: int) -> Iterator[SampleBatch]:
    """Yield batches with one message of every tag. Tag k moves as in run k % len(runs)."""
    tags = [(run, copy * len(runs) + k) for copy in range(copies) for k, run in enumerate(runs)]
    imu, ranges = [imu_of(*tag) for tag in tags], [ranges_of(*tag) for tag in tags]
    for k in range(round(END_S / MESSAGE_S)):
        yield SampleBatch(imu=messages(imu, k), ranges=messages(ranges, k))


def settings_of(run: Simulation) -> Array:
    settings = default_settings()
    settings["heading_source"], settings["mount_angle"] = HeadingSource.IMU, 0.0
    settings["start_known"], settings["start_std"] = True, 0.1
    settings["start_x"], settings["start_y"] = run.truth.x[0], run.truth.y[0]
    settings["start_heading"] = run.truth.heading[0]
    return settings


def cost_of(engine: Engine, runs: list[Simulation], copies: int) -> tuple[float, float]:
    """Return the CPU time per tag and second in µs once settled, and the share of poses that are tracking."""
    engine.set_anchors(np.zeros(1, ANCHOR))
    for row in range(copies * len(runs)):
        engine.configure(row, settings_of(runs[row % len(runs)]))
    costs, tracking = [], []
    for k, batch in enumerate(batches(runs, copies)):
        began = time.process_time()
        poses = engine.process(batch).poses
        seconds = time.process_time() - began
        assert len(poses) == len(batch.ranges)
        if k * MESSAGE_S >= SETTLED_S:
            costs.append(seconds * 1e6 / (copies * len(runs) * MESSAGE_S))
            tracking.append(float((poses["state"] == State.TRACKING).mean()))
    return statistics.median(costs), statistics.mean(tracking)


def cost_of_plain_filters(runs: list[Simulation]) -> float:
    """Return the CPU time per tag and second in µs of a filterpy EKF per tag, which gets a simulated heading."""
    costs = []
    for run in runs:
        start = np.array([run.truth.x[0], run.truth.y[0], run.truth.course[0], 0.0, 0.0])
        pose = PoseFilter(start, np.diag([0.01, 0.01, 0.01, 0.1, 0.1]), np.array([1e-4, 1e-4, 1e-4, 0.5, 0.5]))
        headings = np.interp(run.ranges.t_s, run.scalars.t_s, np.unwrap(run.scalars.heading_rad)).tolist()
        ranges = run.ranges.range_m.tolist()
        settled = int(np.searchsorted(run.ranges.t_s, SETTLED_S))
        began = time.process_time()
        for heading, z in zip(headings[:settled], ranges[:settled], strict=True):
            pose.advance(0.1)
            pose.update_heading(heading, 0.0025)
            pose.update_range(z, 0.04, (0.0, 0.0, 0.0), 1e3)
        costs.append((time.process_time() - began) * 1e6 / SETTLED_S)
        assert math.isfinite(float(pose.x[0]))
    return statistics.median(costs)


def cost_of_check(runs: list[Simulation], copies: int) -> float:
    """Return the CPU time per tag and second in µs of the check of the sensors."""
    check, costs = SensorCheck(), []
    for row in range(copies * len(runs)):
        check.start(row)
    for k, batch in enumerate(batches(runs, copies)):
        began = time.process_time()
        assert check.check(batch).samples is batch
        if k * MESSAGE_S >= SETTLED_S:
            costs.append((time.process_time() - began) * 1e6 / (copies * len(runs) * MESSAGE_S))
    return statistics.median(costs)


def bytes_per_tag(engine: FleetEngine, tags: int) -> float:
    return sum(part.nbytes for part in engine.state().values()) / tags


def idle_figures() -> tuple[float, float]:
    """Return the CPU time to configure a tag in µs, and the bytes of a tag that has sent nothing."""
    fleet, settings = FleetEngine(), default_settings()
    began = time.process_time()
    for row in range(IDLE):
        fleet.configure(row, settings)
    return (time.process_time() - began) * 1e6 / IDLE, bytes_per_tag(fleet, IDLE)


def table(costs: dict[str, float]) -> str:
    lines = ["| | µs per tag and second | µs per range | ÷ `fleet` |", "|---|---|---|---|"]
    for name, cost in costs.items():
        lines.append(f"| {name} | {cost:.1f} | {cost / 10.0:.2f} | {cost / costs['`fleet`']:.2f} |")
    return "\n".join(lines)


def test_the_cost_of_the_engines_is_measured() -> None:
    runs = [simulate("M5", seed, preset("calibrated", imu_hz=100.0)) for seed in range(4000, 4000 + RUNS)]
    fleet = FleetEngine()
    cost, tracking = cost_of(fleet, runs, COPIES)
    costs = {"`fleet`": cost, "check of the sensors": cost_of_check(runs, COPIES)}
    costs |= {"plain filterpy EKF per tag": cost_of_plain_filters(runs)}
    costs["`paper`"], _ = cost_of(PaperEngine(TUNED), runs[:2], 1)
    configuring, idle = idle_figures()
    assert tracking > 0.5
    report.record(
        "engines",
        f"{table(costs)}\n\n{RUNS * COPIES} tags in `fleet`, {100 * tracking:.0f} % of their poses tracking, "
        f"{bytes_per_tag(fleet, RUNS * COPIES) / 1e3:.1f} kB each with the slack of the pool; a tag that has sent "
        f"nothing: {idle / 1e3:.1f} kB, configured in {configuring:.0f} µs.",
    )
