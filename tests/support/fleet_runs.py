"""Raw samples of the drives of `fleet_tracks`, and runs of the fleet engine on them."""

from typing import Any

import numpy as np

from dropanchor_service.estimation.columns import (
    ANCHOR,
    HEADING,
    IMU,
    RANGE,
    HeadingSource,
    SampleBatch,
    default_settings,
)
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.smoother.trace import TracingEngine
from support.fleet_tracks import CALIBRATED, DT, drive

STEP = 10  # IMU samples per range


def settings(known: bool = True) -> Any:
    columns = default_settings()
    columns["mount_angle"], columns["range_std"] = 0.0, 0.1
    columns["heading_source"] = HeadingSource.PLATFORM
    if known:
        columns["start_known"], columns["start_x"], columns["start_y"] = True, 10.0, 0.0
    return columns


def samples(seed: int, row: int = 0) -> tuple[SampleBatch, Any]:
    """Return a drive as 100 Hz IMU samples, 10 Hz headings and 10 Hz ranges, and its truth."""
    truth = drive(seed, row=row)
    nodes, n = truth.nodes, len(truth.nodes)
    imu = np.zeros((n - 1) * STEP, IMU)
    imu["row"], imu["t_ns"] = row, np.arange(len(imu)) * 10_000_000
    imu["gyro"][:, 2] = np.repeat(nodes["dyaw"][1:] / DT, STEP)
    half = nodes["dyaw"][1:] / 2  # dv is in the frame at the start of a node, and the body turns with the tag
    forward, left = nodes["dv_forward"][1:], nodes["dv_left"][1:]
    imu["acc"][:, 0] = np.repeat((np.cos(half) * forward + np.sin(half) * left) / DT, STEP)
    imu["acc"][:, 1] = np.repeat((np.cos(half) * left - np.sin(half) * forward) / DT, STEP)
    imu["acc"][:, 2] = 9.80665
    shaking = np.repeat(np.abs(truth.speed[1:]) > 0.0, STEP)[:, None] * np.random.default_rng(seed).standard_normal(
        (len(imu), 3)
    )
    imu["acc"] += 0.3 * shaking
    imu["gyro"] += 0.02 * shaking
    imu["mag"] = np.nan
    headings, ranges = np.zeros(n - 1, HEADING), np.zeros(n - 1, RANGE)
    headings["row"] = ranges["row"] = row
    headings["t_ns"] = ranges["t_ns"] = nodes["t_ns"][:-1]
    headings["heading"], headings["std"] = nodes["heading"][:-1], 0.03
    ranges["range"], ranges["std"] = nodes["z"][:-1], 0.1
    return SampleBatch(imu=imu, ranges=ranges, headings=headings), truth


def engine(rows: int = 1, known: bool = True) -> FleetEngine:
    fleet = FleetEngine(CALIBRATED)
    fleet.set_anchors(np.zeros(1, ANCHOR))
    for row in range(rows):
        fleet.configure(row, settings(known))
    return fleet


def cut(batch: SampleBatch, start_ns: int, end_ns: int) -> SampleBatch:
    def part(columns: Any) -> Any:
        return columns[(columns["t_ns"] >= start_ns) & (columns["t_ns"] < end_ns)]

    return SampleBatch(part(batch.imu), part(batch.ranges), part(batch.headings), part(batch.bearings))


def in_pieces(fleet: FleetEngine, batch: SampleBatch, step_ns: int) -> Any:
    end = int(batch.imu["t_ns"][-1]) + 1
    return np.concatenate([fleet.process(cut(batch, t, t + step_ns)).poses for t in range(0, end, step_ns)])


def error_of(poses: Any, truth: Any) -> Any:
    index = np.round(poses["t_ns"] / (DT * 1e9)).astype(int)
    return np.hypot(poses["x"] - truth.x[index], poses["y"] - truth.y[index])


def traced(seed: int, known: bool = True) -> tuple[TracingEngine, Any, Any]:
    """Return the engine after a drive, its poses and the truth."""
    batch, truth = samples(seed)
    fleet = TracingEngine(CALIBRATED)
    fleet.set_anchors(np.zeros(1, ANCHOR))
    fleet.configure(0, settings(known))
    return fleet, in_pieces(fleet, batch, 1_000_000_000), truth
