"""Live simulated tags: wire samples in order of time, generated as they are needed."""

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from dropanchor_schemas.wire import BearingSample, ImuSample, RangeSample, Vector, anchor_number
from dropanchor_tag_client.simulator.azimuth import Azimuths
from dropanchor_tag_client.simulator.imu import Imu, draw_unit
from dropanchor_tag_client.simulator.noise import Stream, stream
from dropanchor_tag_client.simulator.ranging import AnchorPlace, Ranges
from dropanchor_tag_client.simulator.scenarios import trajectory
from dropanchor_tag_client.simulator.sensors import SensorModels
from dropanchor_tag_client.simulator.simulation import Simulation, measured_azimuths, observe, simulate
from dropanchor_tag_client.simulator.trajectory import Array, Trajectory, joined
from dropanchor_tag_client.simulator.wander import HABITS, Wanderer

YARD = "yard"
YARD_IMU_HZ = 100.0
REST_BEFORE_S = 2.0


class StartPose(NamedTuple):
    """Position of a tag at t = 0, m, and heading of its body, rad."""

    x: float
    y: float
    heading_rad: float


class Delivery(NamedTuple):
    """Samples of the tag with index `tag`, to be published `due_s` after the start; each group in order of time."""

    due_s: float
    tag: int
    imu: list[ImuSample]
    ranges: list[RangeSample]
    bearings: list[BearingSample]


class _Stretch(NamedTuple):
    imu: Imu
    ranges: Ranges
    azimuths: Azimuths | None


def tag_name(index: int) -> str:
    return f"sim-{index + 1}"


def start_poses(count: int, seed: int = 0, scenario: str = YARD) -> list[StartPose]:
    """Return the true start poses of the tags of `deliveries` with the same count, seed and scenario."""
    if scenario == YARD:
        starts = [_wanderer(seed, index, YARD_IMU_HZ).start for index in range(count)]
        return [StartPose(start.x, start.y, start.course) for start in starts]
    motions = [trajectory(scenario, seed + index) for index in range(count)]
    return [StartPose(float(m.x[0]), float(m.y[0]), float(m.course[0])) for m in motions]


def deliveries(
    count: int, scenario: str, seed: int, models: SensorModels, t0_ns: int, step_s: float = 0.05
) -> Iterator[Delivery]:
    """Yield what `count` tags send, in order of time, in bundles of `step_s`. `t0_ns` is the time of t = 0.

    The scenario "yard" is endless and generated leg by leg. In the other scenarios tag i has seed + i and 2 s of
    additional rest at the start. Raises UnknownScenarioError, and ValueError if the sensors need a finite scenario.
    """
    if scenario == YARD:
        _check_endless(models)
    tags = [_tag(scenario, seed, index, models) for index in range(count)]
    bundles = [_bundles(index, stretches, models.anchors, t0_ns, step_s) for index, stretches in enumerate(tags)]
    return heapq.merge(*bundles, key=attrgetter("due_s"))


def simulation(scenario: str, seed: int, index: int, models: SensorModels, duration_s: float | None) -> Simulation:
    """Return the run of tag `index` with its truth, for a recording.

    The motion equals that of the live tag; the noise differs. `duration_s` cuts the motion. Without it, the yard lasts
    60 s and other scenarios run to their end.
    """
    if scenario != YARD:
        motion = trajectory(scenario, seed + index)
        return _until(motion, scenario, seed + index, models, duration_s)
    motion = _yard_motion(seed, index, models.imu.hz or YARD_IMU_HZ, duration_s or 60.0)
    return observe(YARD, _tag_seed(seed, index), motion, models)


def _until(motion: Trajectory, scenario: str, seed: int, models: SensorModels, duration_s: float | None) -> Simulation:
    if duration_s is None:
        return simulate(scenario, seed, models)
    hz = models.imu.hz or 1.0 / motion.dt
    times = np.arange(0.0, min(duration_s, float(motion.t[-1])) + 1e-9, 1.0 / hz)
    return observe(scenario, seed, motion.at(times), models)


def _yard_motion(seed: int, index: int, hz: float, duration_s: float) -> Trajectory:
    stretches = _wanderer(seed, index, hz).motions()
    motion = next(stretches)
    while motion.t[-1] < duration_s:
        motion = joined(motion, next(stretches))
    return motion.at(np.arange(0.0, duration_s + 1e-9, 1.0 / hz))


def _check_endless(models: SensorModels) -> None:
    ranges, error = models.ranges, models.heading_error
    if (
        ranges.burst_count
        or ranges.outage_s
        or ranges.delay_s
        or error.correlated_std
        or models.first_seen_s is not None
    ):
        raise ValueError(
            "nlosburst, outage5, hcorr, late15, combo and delays need a scenario with an end, not the yard"
        )


def _wanderer(seed: int, index: int, hz: float) -> Wanderer:
    return Wanderer(HABITS[index % len(HABITS)], stream(seed, Stream.MOTION, index), 1.0 / hz)


def _tag_seed(seed: int, index: int) -> int:
    """Return the seed of the sensors of one tag in the yard."""
    return int(np.random.SeedSequence(seed, spawn_key=(index,)).generate_state(1)[0])


def _tag(scenario: str, seed: int, index: int, models: SensorModels) -> Iterator[_Stretch]:
    if scenario == YARD:
        return _in_the_yard(seed, index, models)
    return _in_a_scenario(scenario, seed + index, models)


def _in_a_scenario(scenario: str, seed: int, models: SensorModels) -> Iterator[_Stretch]:
    motion = trajectory(scenario, seed)
    if motion.v[0] == 0.0:
        motion = motion.after_rest(REST_BEFORE_S)
    hz = models.imu.hz or 1.0 / motion.dt
    run = observe(scenario, seed, motion.at(np.arange(0.0, float(motion.t[-1]) + 1e-9, 1.0 / hz)), models)
    yield _Stretch(run.imu, run.ranges, run.azimuths)


def _in_the_yard(seed: int, index: int, models: SensorModels) -> Iterator[_Stretch]:
    own = _tag_seed(seed, index)
    unit = draw_unit(models.imu, models.mount_rad, stream(own, Stream.IMU_UNIT))
    imu_rng, range_rng, azimuth_rng = (stream(own, use) for use in (Stream.IMU, Stream.RANGE, Stream.AZIMUTH))
    ranging = models.ranges if models.ranges.hz else replace(models.ranges, hz=YARD_IMU_HZ)
    for motion in _wanderer(seed, index, models.imu.hz or YARD_IMU_HZ).motions():
        error = models.heading_error.draw(motion, imu_rng)
        ranges = ranging.measure(motion, models.height_m, models.anchors, range_rng)
        new = ranges.where((ranges.t_s > float(motion.t[0]) + 1e-6) & (ranges.t_s > -1e-6))
        azimuths = measured_azimuths(models, motion, new, azimuth_rng)
        yield _Stretch(unit.measure(motion, imu_rng, error), new, azimuths)


def _bundles(
    tag: int, stretches: Iterator[_Stretch], anchors: Sequence[AnchorPlace], t0_ns: int, step_s: float
) -> Iterator[Delivery]:
    numbers = [anchor_number(anchor.id) for anchor in anchors]
    for imu, ranges, azimuths in stretches:
        first, last = imu.t_s[0], max(imu.t_s[-1], ranges.t_s.max(initial=0.0))
        edges = np.arange(np.floor(first / step_s) + 1, np.ceil(last / step_s) + 2) * step_s
        samples, measured = iter(_imu_samples(imu, t0_ns)), iter(_range_samples(ranges, numbers, t0_ns))
        directions = iter(_bearing_samples(azimuths, numbers, t0_ns))
        of_azimuths = np.empty(0) if azimuths is None else azimuths.t_s
        counts = zip(edges.tolist(), *(_counts(t_s, edges) for t_s in (imu.t_s, ranges.t_s, of_azimuths)), strict=True)
        for edge, n_imu, n_ranges, n_azimuths in counts:
            taken = [*islice(samples, n_imu)], [*islice(measured, n_ranges)], [*islice(directions, n_azimuths)]
            if n_imu or n_ranges:
                yield Delivery(min(edge, float(last)), tag, *taken)


def _counts(times: Array, edges: Array) -> list[int]:
    """Return the number of times between each edge and the previous one."""
    return [int(n) for n in np.diff(np.searchsorted(times, edges - 1e-9), prepend=0)]


def _imu_samples(imu: Imu, t0_ns: int) -> Iterator[ImuSample]:
    rows = zip(_times_ns(imu.t_s, t0_ns), imu.acc.tolist(), imu.gyro.tolist(), imu.mag.tolist(), strict=True)
    for t_ns, acc, gyro, mag in rows:
        yield ImuSample(t_ns, _vector(acc), _vector(gyro), _vector(mag))


def _range_samples(ranges: Ranges, numbers: Sequence[int], t0_ns: int) -> Iterator[RangeSample]:
    columns = (ranges.anchor.tolist(), ranges.range_m.tolist(), ranges.std_m.tolist())
    for t_ns, anchor, range_m, std_m in zip(_times_ns(ranges.t_s, t0_ns), *columns, strict=True):
        yield RangeSample(t_ns, numbers[anchor], range_m, std_m)


def _bearing_samples(azimuths: Azimuths | None, numbers: Sequence[int], t0_ns: int) -> Iterator[BearingSample]:
    if azimuths is None:
        return
    columns = (column.tolist() for column in azimuths[1:])
    for t_ns, anchor, azimuth_rad, std_rad in zip(_times_ns(azimuths.t_s, t0_ns), *columns, strict=True):
        yield BearingSample(t_ns, numbers[anchor], azimuth_rad, std_rad)


def _times_ns(times: Array, t0_ns: int) -> list[int]:
    return [t0_ns + round(t * 1e9) for t in times.tolist()]


def _vector(values: Sequence[float]) -> Vector:
    x, y, z = values
    return x, y, z
