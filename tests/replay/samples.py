"""The samples of a golden replay: simulated once, kept in a file, read back for every test.

A line is one sample: `imu,t,acc(3),gyro(3),mag(3)`, `range,t,anchor,range,std`, `heading,t,heading` or
`bearing,t,anchor,bearing,std`; SI units and rad, t in s, an empty field is NaN. Values are rounded as a tag would.
"""

import csv
import gzip
import io
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dropanchor_service.estimation.columns import (
    BEARING,
    HEADING,
    IMU,
    RANGE,
    Array,
    HeadingSource,
    SampleBatch,
    anchors_at,
    default_settings,
)
from dropanchor_tag_client.simulator.imu import Imu
from dropanchor_tag_client.simulator.scalar import AT_REST_MPS, ScalarModel
from dropanchor_tag_client.simulator.simulation import Simulation, simulate
from replay.scenarios import Scenario

FOLDER = Path(__file__).parent
NS_PER_S = 1e9
BATCH_S = 0.2
HEADING_EVERY = 5  # of the instants of the IMU
BEARING_STD = 0.1  # rad
START_STD = 0.1  # m
SCALARS = ScalarModel()
Line = tuple[str, float, list[float]]


def write_samples(name: str, scenario: Scenario) -> None:
    """Simulate the scenario and write its samples to `<name>.csv.gz`, with the same bytes every time."""
    lines = sorted(_lines(scenario, simulated(scenario)), key=lambda line: line[1])
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([kind, f"{t:.3f}", *map(_number, values)] for kind, t, values in lines if _is_sent(t, scenario))
    (FOLDER / f"{name}.csv.gz").write_bytes(gzip.compress(text.getvalue().encode(), mtime=0))


def simulated(scenario: Scenario) -> Simulation:
    return simulate(scenario.motion, scenario.seed, scenario.models)


def read_batches(name: str) -> Iterator[SampleBatch]:
    """Return the samples of `<name>.csv.gz` as row 0, in batches of 0.2 s."""
    with gzip.open(FOLDER / f"{name}.csv.gz", "rt", newline="") as file:
        lines = [(kind, float(t), [float(v or "nan") for v in values]) for kind, t, *values in csv.reader(file)]
    for k in range(math.ceil(lines[-1][1] / BATCH_S) + 1):
        yield _batch([line for line in lines if round(line[1] * 1000) // round(BATCH_S * 1000) == k])


def anchors_of(scenario: Scenario) -> Array:
    """Return ANCHOR of the scenario."""
    return anchors_at(*((anchor.x, anchor.y, anchor.z) for anchor in scenario.models.anchors))


def settings_of(scenario: Scenario) -> Array:
    """Return TAG_SETTINGS (0-d): what an operator would say about the simulated tag."""
    truth = simulated(scenario).truth
    settings = default_settings()
    settings["height"] = scenario.models.height_m
    settings["mount_angle"] = scenario.models.mount_rad
    settings["reverse_allowed"] = scenario.reverse_allowed
    settings["heading_source"] = HeadingSource.IMU if scenario.feed.startswith("raw") else HeadingSource.PLATFORM
    if scenario.start_known:
        settings["start_known"], settings["start_std"] = True, START_STD
        settings["start_x"], settings["start_y"] = round(truth.x[0], 3), round(truth.y[0], 3)
        if scenario.feed.startswith("raw"):
            settings["start_heading"] = round(truth.heading[0], 3)
    return settings


def _is_sent(t: float, scenario: Scenario) -> bool:
    first, last = scenario.silent_s
    return t <= scenario.duration_s and not first <= t < last


def _lines(scenario: Scenario, simulation: Simulation) -> Iterator[Line]:
    if scenario.feed != "heading":
        yield from _imu_lines(simulation.imu if scenario.feed.startswith("raw") else _level_imu(simulation), scenario)
    if scenario.feed in ("heading", "level"):
        headings = simulation.scalars.heading_rad[::HEADING_EVERY]
        for t, heading in zip(simulation.scalars.t_s[::HEADING_EVERY], headings, strict=True):
            yield "heading", t, [round(heading, 4)]
    ranges = simulation.ranges
    for t, anchor, measured in zip(ranges.t_s, ranges.anchor, ranges.range_m, strict=True):
        yield "range", t, [anchor, round(measured, 3), scenario.models.ranges.std]
    if scenario.bearings:
        yield from _bearing_lines(scenario, simulation)


def _level_imu(simulation: Simulation) -> Imu:
    """Return the level IMU with noise on the axes that it does not simulate: silent ones look like a standstill."""
    level, rng = simulation.level_imu(), np.random.default_rng([simulation.seed, 1])
    at_rest = np.abs(simulation.truth.v) < AT_REST_MPS
    acc_std = np.where(at_rest, SCALARS.acceleration_std_rest, SCALARS.acceleration_std)
    level.acc[:, 1:] += acc_std[:, None] * rng.standard_normal((len(acc_std), 2))
    level.gyro[:, :2] += SCALARS.gyro_std * rng.standard_normal((len(acc_std), 2))
    return level


def _imu_lines(imu: Imu, scenario: Scenario) -> Iterator[Line]:
    for t, acc, gyro, mag in zip(*imu, strict=True):
        field = [] if scenario.feed != "raw9" else mag.round(1).tolist()
        yield "imu", t, [*acc.round(3).tolist(), *gyro.round(4).tolist(), *field]


def _bearing_lines(scenario: Scenario, simulation: Simulation) -> Iterator[Line]:
    """Bearings of anchor 0, which the simulator does not have: from the truth, with white noise."""
    truth, every = simulation.truth, round(1.0 / simulation.truth.t_s[1])
    noise = np.random.default_rng(scenario.seed).normal(0.0, BEARING_STD, len(truth.t_s))
    for k in range(0, len(truth.t_s), every):
        bearing = math.remainder(math.atan2(truth.y[k], truth.x[k]) + noise[k], math.tau)
        yield "bearing", truth.t_s[k], [0, round(bearing, 4), BEARING_STD]


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:g}" if value == round(value) else repr(float(value))


def _batch(lines: list[Line]) -> SampleBatch:
    parts: dict[str, list[tuple[object, ...]]] = {"imu": [], "range": [], "heading": [], "bearing": []}
    for kind, t, values in lines:
        t_ns = round(t * NS_PER_S)
        if kind == "imu":
            mag = values[6:9] or [math.nan] * 3
            parts[kind].append((0, t_ns, values[0:3], values[3:6], mag))
        elif kind == "heading":
            parts[kind].append((0, t_ns, values[0], math.nan))
        else:
            parts[kind].append((0, t_ns, int(values[0]), values[1], values[2]))
    return SampleBatch(
        imu=np.array(parts["imu"], IMU),
        ranges=np.array(parts["range"], RANGE),
        headings=np.array(parts["heading"], HEADING),
        bearings=np.array(parts["bearing"], BEARING),
    )
