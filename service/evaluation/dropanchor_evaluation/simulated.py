"""Run engines on simulated runs. Each run is a separate tag, so one engine processes many runs together."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from dropanchor_service.estimation.columns import (
    HEADING,
    IMU,
    POSE,
    PRESSURE,
    RANGE,
    Array,
    HeadingSource,
    SampleBatch,
    anchors_at,
    default_settings,
)
from dropanchor_service.estimation.protocols import Engine
from dropanchor_service.offline.accuracy import Truth
from dropanchor_service.offline.replay import NS_PER_S, STEP_S, Track
from dropanchor_tag_client.simulator.imu import Imu
from dropanchor_tag_client.simulator.scalar import AT_REST_MPS, ScalarModel
from dropanchor_tag_client.simulator.simulation import Simulation

Feed = Literal["heading", "level", "raw", "raw 6-axis", "raw 6-axis and heading"]
"""The samples of an engine in addition to the ranges: the scalar heading; the scalar heading and a level IMU without a
magnetometer; raw samples of 9 or 6 axes, so that the engine uses its own attitude filter; or 6 axes and the scalar
heading."""

WITHOUT_HEADING: frozenset[Feed] = frozenset({"raw", "raw 6-axis"})

START_STD = 0.1  # m
NOISE = ScalarModel()
OTHER_AXES = 7  # random stream of `_noisy`


@dataclass(frozen=True)
class PriorKnowledge:
    """What an operator knows about the tags of an experiment.

    start: whether the true start is given (with the heading if the engine must find it from raw samples).
    heading_std: of the scalar heading, rad. calibrated: whether the settings state that ranges have no bias and that
    the tag never slips, both true in the simulation. exact_heading: with calibrated, whether they also state that the
    scalar heading has only white noise, as the bound assumes.
    """

    feed: Feed = "level"
    start: bool = True
    heading_std: float = np.nan
    reverse: bool = False
    calibrated: bool = False
    exact_heading: bool = True


@dataclass(frozen=True)
class Timed:
    """tracks: one per run, in the order of the runs; seconds: processor time of the engine for all runs."""

    tracks: list[Track]
    seconds: float


def truth_of(simulation: Simulation) -> Truth:
    return Truth(simulation.truth.t_s, simulation.truth.x, simulation.truth.y)


def run_engine(engine: Engine, simulations: Sequence[Simulation], known: PriorKnowledge) -> Timed:
    """Run a fresh engine on all runs, run i as row i, one second at a time. All runs must have the same anchors."""
    configure(engine, simulations, known)
    started = time.process_time()
    steps = [engine.process(batch).poses for batch in batches(_together(simulations, known))]
    seconds = time.process_time() - started
    poses = np.concatenate([np.empty(0, POSE), *steps])
    by_row = [poses[poses["row"] == row] for row in range(len(simulations))]
    return Timed([Track(own["t_ns"] / NS_PER_S, own) for own in by_row], seconds)


def configure(engine: Engine, simulations: Sequence[Simulation], known: PriorKnowledge) -> None:
    """Set the anchors of a fresh engine, and make run i its row i. All runs must have the same anchors."""
    engine.set_anchors(anchors_at(*((a.x, a.y, a.z) for a in simulations[0].anchors)))
    for row, simulation in enumerate(simulations):
        engine.configure(row, _settings(simulation, known))


def _settings(simulation: Simulation, known: PriorKnowledge) -> Array:
    truth = simulation.truth
    settings = default_settings()
    settings["height"] = truth.z[0]
    settings["mount_angle"] = truth.course[0] - truth.heading[0]
    settings["reverse_allowed"] = known.reverse
    settings["heading_source"] = HeadingSource.IMU if known.feed in WITHOUT_HEADING else HeadingSource.PLATFORM
    if known.calibrated:
        settings["range_bias_std"] = settings["mount_angle_std"] = settings["slip_std"] = 0.0
        if known.exact_heading:
            settings["heading_std"] = 0.0
    settings["range_std"] = simulation.ranges.std_m[0]
    if known.start:
        settings["start_known"], settings["start_std"] = True, START_STD
        settings["start_x"], settings["start_y"] = truth.x[0], truth.y[0]
        settings["start_heading"] = truth.heading[0] if known.feed in WITHOUT_HEADING else np.nan
    return settings


def _together(simulations: Sequence[Simulation], known: PriorKnowledge) -> SampleBatch:
    """Return all samples of all runs in order of time."""
    return merged([samples_of(one, known.feed, known.heading_std, row) for row, one in enumerate(simulations)])


def samples_of(simulation: Simulation, feed: Feed, heading_std: float = np.nan, row: int = 0) -> SampleBatch:
    """Return what the tag sends, as samples of this row. heading_std: as the heading samples report it, rad."""
    return SampleBatch(
        imu=_imu(row, simulation, feed),
        ranges=_ranges(row, simulation),
        headings=_headings(row, simulation, feed, heading_std),
    )


def merged(parts: Sequence[SampleBatch]) -> SampleBatch:
    """Return all samples in order of time."""
    return SampleBatch(
        imu=_in_order([part.imu for part in parts], IMU),
        ranges=_in_order([part.ranges for part in parts], RANGE),
        headings=_in_order([part.headings for part in parts], HEADING),
        pressures=_in_order([part.pressures for part in parts], PRESSURE),
    )


def _imu(row: int, simulation: Simulation, feed: Feed) -> Array:
    if feed == "heading":
        return np.empty(0, IMU)
    measured: Imu = _noisy(simulation.level_imu(), simulation) if feed == "level" else simulation.imu
    samples = _empty(row, measured.t_s, IMU)
    samples["acc"], samples["gyro"] = measured.acc, measured.gyro
    samples["mag"] = measured.mag if feed == "raw" else np.nan
    return samples


def _noisy(level: Imu, simulation: Simulation) -> Imu:
    """Add noise to the axes that the scalar sensors lack. Without it, these axes would indicate a standstill."""
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


def _headings(row: int, simulation: Simulation, feed: Feed, heading_std: float) -> Array:
    if feed in WITHOUT_HEADING:
        return np.empty(0, HEADING)
    samples = _empty(row, simulation.scalars.t_s, HEADING)
    samples["heading"], samples["std"] = simulation.scalars.heading_rad, heading_std
    return samples


def _empty(row: int, t_s: Array, dtype: Any) -> Array:
    samples = np.zeros(len(t_s), dtype)
    samples["row"], samples["t_ns"] = row, np.rint(t_s * NS_PER_S)
    return samples


def _in_order(parts: list[Array], dtype: Any) -> Array:
    samples = np.concatenate([np.empty(0, dtype), *parts])
    return samples[np.argsort(samples["t_ns"], kind="stable")]


def batches(batch: SampleBatch, step_s: float = STEP_S) -> Iterator[SampleBatch]:
    """Cut samples in order of time into stretches of `step_s`."""
    kinds = (batch.imu, batch.ranges, batch.headings, batch.pressures)
    last = max(samples["t_ns"][-1] for samples in kinds if len(samples))
    edges = np.arange(0, last + NS_PER_S * step_s + 1, NS_PER_S * step_s)
    cuts = [np.searchsorted(samples["t_ns"], edges) for samples in kinds]
    for i in range(len(edges) - 1):
        parts = [samples[cut[i] : cut[i + 1]] for samples, cut in zip(kinds, cuts, strict=True)]
        imu, ranges, headings, pressures = parts
        yield SampleBatch(imu=imu, ranges=ranges, headings=headings, pressures=pressures)
