"""The engines on simulated runs: every run is a tag of its own, so that an engine takes many of them at once."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from dropanchor_service.estimation.batch import (
    ANCHOR,
    HEADING,
    IMU,
    POSE,
    RANGE,
    Array,
    Engine,
    HeadingSource,
    SampleBatch,
    default_settings,
)
from dropanchor_service.evaluation.accuracy import Truth
from dropanchor_service.evaluation.replay import NS_PER_S, STEP_S, Track
from dropanchor_tag_client.simulator.imu import Imu
from dropanchor_tag_client.simulator.scalar import AT_REST_MPS, ScalarModel
from dropanchor_tag_client.simulator.simulation import Simulation

Feed = Literal["heading", "level", "raw"]
"""What an engine gets beside the ranges: the scalar heading; the scalar heading and a level IMU without a magnetometer;
or raw 9-axis samples and nothing else, so that its own attitude filter is in the loop."""

START_STD = 0.1  # m
NOISE = ScalarModel()
OTHER_AXES = 7  # names the random numbers of `_noisy`


@dataclass(frozen=True)
class Known:
    """What an operator knows of the tags of an experiment.

    start: whether the true start is given (with the heading where it is raw samples that must find it). heading_std:
    of the scalar heading, rad. calibrated: the operator says what is true of a simulated tag, that its ranges have no
    bias and that it travels exactly as its mounting angle says; with exact_heading also that the scalar heading has no
    error but its white noise, as the bound assumes.
    """

    feed: Feed = "level"
    start: bool = True
    heading_std: float = np.nan
    reverse: bool = False
    calibrated: bool = False
    exact_heading: bool = True


@dataclass(frozen=True)
class Timed:
    """tracks: one per run, in their order; seconds: of processor time that the engine took for all of them."""

    tracks: list[Track]
    seconds: float


def truth_of(simulation: Simulation) -> Truth:
    return Truth(simulation.truth.t_s, simulation.truth.x, simulation.truth.y)


def run_engine(engine: Engine, simulations: Sequence[Simulation], known: Known) -> Timed:
    """Feed a fresh engine all runs, run i as row i, one second at a time. All runs must have the same anchors."""
    engine.set_anchors(np.array([(a.x, a.y, a.z) for a in simulations[0].anchors], ANCHOR))
    for row, simulation in enumerate(simulations):
        engine.configure(row, _settings(simulation, known))
    started = time.process_time()
    steps = [engine.process(batch).poses for batch in _seconds(_together(simulations, known))]
    seconds = time.process_time() - started
    poses = np.concatenate([np.empty(0, POSE), *steps])
    by_row = [poses[poses["row"] == row] for row in range(len(simulations))]
    return Timed([Track(own["t_ns"] / NS_PER_S, own) for own in by_row], seconds)


def _settings(simulation: Simulation, known: Known) -> Array:
    truth = simulation.truth
    settings = default_settings()
    settings["height"] = truth.z[0]
    settings["mount_angle"] = truth.course[0] - truth.heading[0]
    settings["reverse_allowed"] = known.reverse
    settings["heading_source"] = HeadingSource.IMU if known.feed == "raw" else HeadingSource.PLATFORM
    if known.calibrated:
        settings["range_bias_std"] = settings["mount_angle_std"] = settings["slip_std"] = 0.0
        if known.exact_heading:
            settings["heading_std"] = 0.0
    settings["range_std"] = simulation.ranges.std_m[0]
    if known.start:
        settings["start_known"], settings["start_std"] = True, START_STD
        settings["start_x"], settings["start_y"] = truth.x[0], truth.y[0]
        settings["start_heading"] = truth.heading[0] if known.feed == "raw" else np.nan
    return settings


def _together(simulations: Sequence[Simulation], known: Known) -> SampleBatch:
    """All samples of all runs, in order of time."""
    rows = list(enumerate(simulations))
    return SampleBatch(
        imu=_in_order([_imu(row, one, known.feed) for row, one in rows], IMU),
        ranges=_in_order([_ranges(row, one) for row, one in rows], RANGE),
        headings=_in_order([_headings(row, one, known) for row, one in rows], HEADING),
    )


def _imu(row: int, simulation: Simulation, feed: Feed) -> Array:
    if feed == "heading":
        return np.empty(0, IMU)
    measured: Imu = simulation.imu if feed == "raw" else _noisy(simulation.level_imu(), simulation)
    samples = _empty(row, measured.t_s, IMU)
    samples["acc"], samples["gyro"], samples["mag"] = measured.acc, measured.gyro, measured.mag
    return samples


def _noisy(level: Imu, simulation: Simulation) -> Imu:
    """Noise on the axes that the scalar sensors lack, of their kind: silent axes would tell of a standstill."""
    rng = np.random.default_rng([simulation.seed, OTHER_AXES])
    rest = np.abs(simulation.truth.v) < AT_REST_MPS
    acc_std = np.where(rest, NOISE.acceleration_std_rest, NOISE.acceleration_std)
    level.acc[:, 1:] += acc_std[:, None] * rng.standard_normal((len(rest), 2))
    level.gyro[:, :2] += NOISE.gyro_std * rng.standard_normal((len(rest), 2))
    return level


def _ranges(row: int, simulation: Simulation) -> Array:
    measured = simulation.ranges
    samples = _empty(row, measured.t_s, RANGE)
    samples["anchor"], samples["range"], samples["std"] = measured.anchor, measured.range_m, measured.std_m
    return samples


def _headings(row: int, simulation: Simulation, known: Known) -> Array:
    if known.feed == "raw":
        return np.empty(0, HEADING)
    samples = _empty(row, simulation.scalars.t_s, HEADING)
    samples["heading"], samples["std"] = simulation.scalars.heading_rad, known.heading_std
    return samples


def _empty(row: int, t_s: Array, dtype: Any) -> Array:
    samples = np.zeros(len(t_s), dtype)
    samples["row"], samples["t_ns"] = row, np.rint(t_s * NS_PER_S)
    return samples


def _in_order(parts: list[Array], dtype: Any) -> Array:
    samples = np.concatenate([np.empty(0, dtype), *parts])
    return samples[np.argsort(samples["t_ns"], kind="stable")]


def _seconds(batch: SampleBatch) -> Iterator[SampleBatch]:
    kinds = (batch.imu, batch.ranges, batch.headings)
    last = max(samples["t_ns"][-1] for samples in kinds if len(samples))
    edges = np.arange(0, last + NS_PER_S * STEP_S + 1, NS_PER_S * STEP_S)
    cuts = [np.searchsorted(samples["t_ns"], edges) for samples in kinds]
    for i in range(len(edges) - 1):
        imu, ranges, headings = (samples[cut[i] : cut[i + 1]] for samples, cut in zip(kinds, cuts, strict=True))
        yield SampleBatch(imu=imu, ranges=ranges, headings=headings)
