"""One run of one tag: its true motion and its samples."""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from dropanchor_tag_client.simulator.azimuth import Azimuths
from dropanchor_tag_client.simulator.imu import GRAVITY, Attitude, Imu, ImuUnit, draw_unit, quaternions, turned
from dropanchor_tag_client.simulator.noise import Stream, stream
from dropanchor_tag_client.simulator.ranging import AnchorPlace, Ranges, sample_times
from dropanchor_tag_client.simulator.scalar import AT_REST_MPS, Scalars, backward_rate
from dropanchor_tag_client.simulator.scenarios import trajectory
from dropanchor_tag_client.simulator.sensors import SensorModels
from dropanchor_tag_client.simulator.trajectory import Array, Trajectory


class Truth(NamedTuple):
    """The true motion, as columns (n,). Angles are not wrapped.

    x, y, z: position, m. heading: body yaw, rad. course: direction of the forward axis, rad. v: speed along the
    course, m/s. w: yaw rate, rad/s. attitude: (n, 4) quaternion (w, x, y, z) body → ENU.
    """

    t_s: Array
    x: Array
    y: Array
    z: Array
    heading: Array
    course: Array
    v: Array
    w: Array
    attitude: Array


@dataclass(frozen=True)
class Simulation:
    """Truth and samples of a run. Times are in s from the start of the motion.

    imu: raw 9-axis samples. scalars: heading, yaw rate and forward acceleration with independent noise. truth, imu and
    scalars share their instants; ranges have their own. azimuths: None where the anchors measure none.
    """

    scenario: str
    seed: int
    anchors: tuple[AnchorPlace, ...]
    truth: Truth
    imu: Imu
    ranges: Ranges
    scalars: Scalars
    azimuths: Azimuths | None = None

    def level_imu(self) -> Imu:
        """Return the scalar samples as those of a level IMU without a magnetometer (NaN).

        Its x axis points along the heading. The scalar sensors do not measure the acceleration to the left of the
        course, so it is the true v·w, over the same time as the turn and the acceleration along it.
        """
        n = len(self.scalars.t_s)
        zero = np.zeros(n)
        mount = self.truth.course - self.truth.heading
        left = self.truth.v * backward_rate(self.truth.course, float(self.truth.t_s[1] - self.truth.t_s[0]))
        acc = turned(self.scalars.acceleration_mps2, left, zero + GRAVITY, mount)
        return Imu(
            self.scalars.t_s, acc, np.column_stack([zero, zero, self.scalars.gyro_radps]), np.full((n, 3), np.nan)
        )


def simulate(scenario: str, seed: int, models: SensorModels | None = None, rest_s: float = 0.0) -> Simulation:
    """Return the run of a scenario with these sensors (default: SensorModels()). Raises UnknownScenarioError.

    rest_s: s for which the tag lies still before. The result depends only on the arguments.
    """
    models = models or SensorModels()
    motion = trajectory(scenario, seed).after_rest(rest_s)
    if models.imu.hz is not None:
        motion = motion.at(sample_times(motion, models.imu.hz))
    return observe(scenario, seed, motion, models)


def observe(scenario: str, seed: int, motion: Trajectory, models: SensorModels) -> Simulation:
    """Return the run of a given motion. `scenario` is only its name.

    Raises ValueError if the motion ends before the tag is first seen.
    """
    if len(motion) < 2:
        raise ValueError("the motion is shorter than the time between two IMU samples")
    error = models.heading_error.draw(motion, stream(seed, Stream.HEADING_ERROR))
    unit = draw_unit(models.imu, models.mount_rad, stream(seed, Stream.IMU_UNIT))
    seen = _first_seen(motion, models.first_seen_s)
    kept = motion.t >= seen
    if np.count_nonzero(kept) < 2:
        raise ValueError(f"there are no samples: the tag is first seen at {seen:.1f} s, after the end of the motion")
    ranges = models.ranges.measure(motion, models.height_m, models.anchors, stream(seed, Stream.RANGE))
    received = ranges.where(ranges.t_s >= seen)
    scalars = models.scalar.measure(motion, models.mount_rad, error, stream(seed, Stream.SCALAR))
    before = with_row_before(motion)
    imu = unit.measure(before, stream(seed, Stream.IMU), np.concatenate([error[:1], error]))
    return Simulation(
        scenario=scenario,
        seed=seed,
        anchors=models.anchors,
        truth=Truth(*(column[kept] for column in truth_of(motion, unit, models.height_m))),
        imu=Imu(*(column[kept] for column in imu)),
        ranges=received,
        scalars=Scalars(*(column[kept] for column in scalars)),
        azimuths=measured_azimuths(models, motion, received, stream(seed, Stream.AZIMUTH)),
    )


def measured_azimuths(
    models: SensorModels, motion: Trajectory, ranges: Ranges, rng: np.random.Generator
) -> Azimuths | None:
    """Return the azimuths that come with these ranges, None where the anchors measure none."""
    return None if models.azimuth is None else models.azimuth.measure(motion, ranges, models.anchors, rng)


def truth_of(motion: Trajectory, unit: ImuUnit, height: float) -> Truth:
    attitude: Attitude = unit.attitude(motion)
    return Truth(
        t_s=motion.t,
        x=motion.x,
        y=motion.y,
        z=np.full(len(motion), height),
        heading=attitude.yaw,
        course=motion.course,
        v=motion.v,
        w=motion.w,
        attitude=quaternions(attitude),
    )


def with_row_before(motion: Trajectory) -> Trajectory:
    """Return the motion with its first row repeated one step earlier, so that it starts without acceleration."""
    columns = [np.concatenate([getattr(motion, f.name)[:1], getattr(motion, f.name)]) for f in fields(motion)]
    columns[0][0] -= motion.dt
    return Trajectory(*columns)


def _first_seen(motion: Trajectory, after_motion_s: float | None) -> float:
    if after_motion_s is None:
        return float(motion.t[0])
    moving = np.flatnonzero(np.abs(motion.v) > AT_REST_MPS)
    return float(motion.t[moving[0]] + after_motion_s) if len(moving) else float(motion.t[0])
