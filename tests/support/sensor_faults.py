"""Samples of a simulated tag whose sensors are wrong in one way, and the track that the service makes of them."""

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import ANCHOR, IMU, POSE, RANGE, Array, SampleBatch, State, default_settings
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.plausibility.check import SensorCheck
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate
from dropanchor_tag_client.simulator.walking import simulate_walk

T0_NS = 1_760_000_000_000_000_000
CARRIED = ("hand", "pocket", "turned")
GRAVITY = 9.80665
Samples = tuple[Array, Array]  # IMU, RANGE
Fault = Callable[[Array, Array], None]  # changes IMU and RANGE in place


@lru_cache(maxsize=8)  # tests with one fault after the other have the same run
def run_of(scenario: str, seed: int, noise: str = "calibrated") -> Simulation:
    """Return a run with IMU samples at 100 Hz and ranges at 10 Hz."""
    if scenario in CARRIED:
        return simulate_walk(scenario, seed)  # type: ignore[arg-type]
    return simulate(scenario, seed, preset(noise, imu_hz=100, range_hz=10))


def samples_of(run: Simulation) -> Samples:
    """Return IMU and RANGE of row 0."""
    imu, ranges = np.zeros(len(run.imu.t_s), IMU), np.zeros(len(run.ranges.t_s), RANGE)
    imu["t_ns"], ranges["t_ns"] = _t_ns(run.imu.t_s), _t_ns(run.ranges.t_s)
    imu["acc"], imu["gyro"], imu["mag"] = run.imu.acc, run.imu.gyro, run.imu.mag
    ranges["range"], ranges["std"], ranges["anchor"] = run.ranges.range_m, np.nan, run.ranges.anchor
    return imu, ranges


def of_imu(name: str, change: Callable[[Array], Any], *more: tuple[str, Callable[[Array], Any]]) -> Fault:
    """Return a fault of one or several sensors of the IMU."""

    def fault(imu: Array, _: Array) -> None:
        for sensor, changed in ((name, change), *more):
            imu[sensor] = changed(imu[sensor])

    return fault


def of_ranges(change: Callable[[Array], Array]) -> Fault:
    """Return a fault of the ranges."""

    def fault(_: Array, ranges: Array) -> None:
        ranges["range"] = change(ranges["range"])

    return fault


def mean_of(count: int) -> Callable[[Array], Array]:
    """Return what a module does that averages its last `count` ranges."""
    return lambda ranges: np.array([ranges[max(0, i - count + 1) : i + 1].mean() for i in range(len(ranges))])


_NO_FIELD = ("mag", lambda mag: np.full_like(mag, np.nan))

FAULTS: dict[str, tuple[Fault, set[str]]] = {
    "accelerations in g": (of_imu("acc", lambda acc: acc / GRAVITY), {"acc_in_g"}),
    "no gravity": (of_imu("acc", lambda acc: acc - (0.0, 0.0, GRAVITY)), {"acc_no_gravity"}),
    "accelerations twice as large": (of_imu("acc", lambda acc: 2.0 * acc), {"acc_scale"}),
    "a silent accelerometer": (of_imu("acc", np.zeros_like), {"acc_silent"}),
    "a repeating accelerometer": (of_imu("acc", lambda acc: acc[0]), {"acc_stuck"}),
    "reversed accelerations": (of_imu("acc", np.negative), {"acc_reversed"}),
    "reversed accelerations without a field": (of_imu("acc", np.negative, _NO_FIELD), {"acc_reversed"}),
    "accelerations along z, y, x": (of_imu("acc", lambda acc: acc[:, ::-1]), {"axes_differ"}),
    "rates in degrees": (of_imu("gyro", lambda gyro: gyro * 180.0 / math.pi), {"gyro_in_deg"}),
    "rates about z, x, y": (of_imu("gyro", lambda gyro: gyro[:, [2, 0, 1]]), {"axes_differ"}),
    "rates about z, y, x": (of_imu("gyro", lambda gyro: gyro[:, ::-1]), {"axes_differ"}),
    "rates about x, z, y": (of_imu("gyro", lambda gyro: gyro[:, [0, 2, 1]]), {"axes_differ"}),
    "reversed rates": (of_imu("gyro", np.negative), {"turns_differ"}),
    "a left-handed gyroscope": (of_imu("gyro", lambda gyro: gyro * (1.0, 1.0, -1.0)), {"turns_differ"}),
    "a repeating gyroscope": (of_imu("gyro", lambda gyro: gyro[0]), {"gyro_stuck"}),
    "a silent gyroscope": (of_imu("gyro", np.zeros_like), {"gyro_stuck"}),
    "a left-handed magnetometer": (of_imu("mag", lambda mag: mag * (1.0, -1.0, 1.0)), {"turns_differ"}),
    "ranges in centimetres": (of_ranges(lambda ranges: 100.0 * ranges), {"range_in_cm"}),
    "ranges that a module averages": (of_ranges(mean_of(5)), {"range_averaged"}),
    "ranges that a module averages for a second": (of_ranges(mean_of(10)), {"range_averaged"}),
}
"""Each fault, and the names of what is found. Faults that end up in another unit's place are not among them."""


class Checked(NamedTuple):
    """poses: POSE. found: time, s from the start, and names of what is wrong, whenever that changes."""

    poses: Array
    found: list[tuple[float, set[str]]]

    @property
    def names(self) -> set[str]:
        return set().union(*(names for _, names in self.found))


def cut(imu: Array, ranges: Array, step_s: float) -> Iterator[SampleBatch]:
    """Yield the samples as messages would bring them, each of `step_s`."""
    begin, end = int(imu["t_ns"][0]), max(int(samples["t_ns"][-1]) for samples in (imu, ranges) if len(samples))
    edges = np.arange(begin, end + 2 * round(step_s * 1e9), round(step_s * 1e9))
    of_imu, of_ranges = np.searchsorted(imu["t_ns"], edges), np.searchsorted(ranges["t_ns"], edges)
    for i in range(len(edges) - 1):
        yield SampleBatch(imu[of_imu[i] : of_imu[i + 1]], ranges[of_ranges[i] : of_ranges[i + 1]])


def verdicts_of(imu: Array, ranges: Array, step_s: float = 1.0, check: SensorCheck | None = None) -> Checked:
    """Return what the check finds, without an engine."""
    check = check or SensorCheck()
    check.start(0)
    found: list[tuple[float, set[str]]] = []
    for batch in cut(imu, ranges, step_s):
        check.check(batch)
        names = {one.name for one in check.findings(0)}
        if names != (found[-1][1] if found else set()):
            found.append(((int(max(check.columns[0]["t_ns"], check.columns[0]["range_ns"])) - T0_NS) * 1e-9, names))
    return Checked(np.empty(0, POSE), found)


def tracked(imu: Array, ranges: Array, run: Simulation, start_known: bool) -> Checked:
    """Return the poses of the check and the engine, as the service puts them together."""
    engine, check, settings = FleetEngine(), SensorCheck(), default_settings()
    engine.set_anchors(np.zeros(1, ANCHOR))
    if start_known:
        settings["start_known"], settings["start_std"] = True, 0.1
        settings["start_x"], settings["start_y"] = run.truth.x[0], run.truth.y[0]
        settings["start_heading"] = run.truth.heading[0]
    engine.configure(0, settings)
    check.start(0)
    found, poses = list[tuple[float, set[str]]](), [np.empty(0, POSE)]
    for batch in cut(imu, ranges, 0.2):
        checked = check.check(batch)
        made = engine.process(checked.samples).poses
        check.mark(made)
        poses += [made, checked.poses]
        for _ in checked.failed:
            engine.configure(0, default_settings())
        names = {one.name for one in check.findings(0)}
        if names != (found[-1][1] if found else set()):
            found.append((0.0, names))
    return Checked(np.concatenate(poses), found)


def beyond(poses: Array, run: Simulation, sigmas: float = 5.0) -> tuple[int, int]:
    """Return how many poses are `tracking` in the site's frame, and how many of them are off by more than `sigmas`."""
    tracking = poses[(poses["state"] == State.TRACKING) & (poses["frame"] == 0)]
    t_s = (tracking["t_ns"] - T0_NS) * 1e-9
    off = np.stack(
        [tracking[name] - np.interp(t_s, run.truth.t_s, getattr(run.truth, name)) for name in ("x", "y")], axis=1
    )
    squared = np.einsum("ij,ij->i", off, np.linalg.solve(tracking["cov"][:, :2, :2], off[..., None])[..., 0])
    return len(tracking), int((squared > sigmas**2).sum())


def _t_ns(t_s: Array) -> Array:
    t_ns: Array = T0_NS + np.round(t_s * 1e9).astype(np.int64)
    return t_ns
