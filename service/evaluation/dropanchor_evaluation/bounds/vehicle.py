"""The linear models of a vehicle's tag about its true path, with the constants that the simulator draws.

States: position, yaw of the body, speed, yaw rate, forward acceleration, mounting angle (course minus yaw), slip, and
the errors of the sensors. Yaw rate and acceleration have no model of their own: only the sensors tell them. Body axes
are turned by the true mounting angle, which loses nothing, and the Jacobians are those of a level body.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dropanchor_evaluation.bounds.linear import LinearModel, Number
from dropanchor_evaluation.pcrb import AT_REST_MPS, Path
from dropanchor_service.estimation.columns import Array
from dropanchor_tag_client.simulator.imu import GRAVITY, ImuModel
from dropanchor_tag_client.simulator.scalar import ScalarModel
from dropanchor_tag_client.simulator.sensors import SensorModels

ANY_ANGLE = math.pi / math.sqrt(3.0)
"""Standard deviation of an angle that is uniform on the circle, rad."""
ANY_PLACE, ANY_SPEED = 30.0, 3.0  # m, m/s
ANY_YAW_RATE, ANY_ACCELERATION = 300.0, 1000.0  # rad/s, m/s²; wide enough to tell nothing of the biases
GAUGE = 1e-3  # m
REST_SPEED, REST_YAW_RATE = 0.02, 1e-3  # m/s, rad/s; accuracy of a detected standstill


@dataclass(frozen=True)
class Knowledge:
    """What is known of a tag: standard deviations at the start, m, rad, m/s, of the mounting angle, and of the slip.

    bearing: whether the direction from the anchor to the start is given, as the axis of a frame of the tag's own.
    slip: Gauss-Markov, rad and s. sideways: whether the acceleration to the left of the body tells anything.
    """

    start: float = 0.1
    bearing: bool = False
    yaw: float = 0.1
    speed: float = 0.02
    mount: float = 0.0
    slip: float = 0.0
    slip_tau: float = 3.0
    sideways: bool = True


@dataclass(frozen=True)
class Motion:
    """The truth: path, yaw rate (n,), and mounting angle, rad."""

    path: Path
    yaw_rate: Array
    mount: float = 0.0

    @property
    def dt(self) -> float:
        return float(self.path.t[-1] - self.path.t[0]) / (len(self.path.t) - 1)

    @property
    def level(self) -> tuple[Array, Array]:
        """Return the acceleration along and to the left of the course, (n,) m/s²."""
        v = self.path.v
        return np.diff(v, prepend=v[0]) / self.dt, v * self.yaw_rate

    @property
    def rest(self) -> Array:
        at_rest: Array = (np.abs(self.path.v) < AT_REST_MPS) & (np.abs(self.yaw_rate) < AT_REST_MPS)
        return at_rest


def scalar_model(motion: Motion, models: SensorModels, known: Knowledge) -> LinearModel:
    """Return the model of a tag that sends its yaw and the samples of a level IMU."""
    m = _body(motion, models.ranges.std, known)
    s: ScalarModel = models.scalar
    m.state("gyro bias", s.gyro_bias_std)
    m.state("acceleration bias", s.acceleration_bias_std)
    m.gauss_markov("leak", s.leak_std, s.leak_tau_s, motion.dt)
    m.observe(s.heading_std, {"yaw": 1.0})
    m.observe(s.gyro_std, {"yaw rate": 1.0, "gyro bias": 1.0})
    noise = np.where(motion.rest, s.acceleration_std_rest, s.acceleration_std)
    forward, left = _along(motion), _sideways(motion)
    forward |= {"acceleration bias": 1.0, "leak": 1.0}
    if known.sideways:
        # The simulator turns the noise along the course into both axes and adds noise to the left one alone. In this
        # combination the two noises are independent. That the first one shows the mounting angle is left out.
        m.observe(noise * abs(math.cos(motion.mount)), left)
        lean = math.tan(motion.mount)
        forward = {name: forward.get(name, 0.0) - lean * left.get(name, 0.0) for name in {**forward, **left}}
    m.observe(noise, forward)
    return m


def raw_model(motion: Motion, models: SensorModels, known: Knowledge, magnetometer: bool) -> LinearModel:
    """Return the model of a tag that sends raw samples of 6 axes, or of 9 with a magnetometer."""
    m = _body(motion, models.ranges.std, known)
    imu = models.imu
    moving = np.minimum(np.abs(motion.path.v), 1.0)
    _tilt(m, motion, imu)
    _gyroscope(m, motion, imu, np.hypot(imu.gyro_std, imu.vibration_gyro * moving))
    _accelerometer(m, motion, imu, np.hypot(imu.acc_std, imu.vibration_acc * moving), known.sideways)
    if magnetometer:
        _magnetometer(m, motion, imu)
    return m


def _body(motion: Motion, range_std: float, known: Knowledge) -> LinearModel:
    path, dt = motion.path, motion.dt
    m = LinearModel(len(path.t))
    for axis in ("x", "y"):
        m.state(axis, known.start)
    m.state("yaw", known.yaw)
    m.state("speed", known.speed)
    m.white("yaw rate", ANY_YAW_RATE)
    m.white("acceleration", ANY_ACCELERATION)
    m.state("mount", known.mount)
    m.gauss_markov("slip", known.slip, known.slip_tau, dt)
    cos, sin, v = (np.roll(column, 1) for column in (np.cos(path.course), np.sin(path.course), path.v))
    for angle in ("yaw", "mount", "slip"):
        m.move("x", angle, -v * sin * dt)
        m.move("y", angle, v * cos * dt)
    m.move("x", "speed", cos * dt)
    m.move("y", "speed", sin * dt)
    m.move("yaw", "yaw rate", dt)
    m.move("speed", "acceleration", dt)
    r = np.hypot(path.x, path.y)
    m.observe(range_std, {"x": path.x / r, "y": path.y / r}, at=path.ranged)
    m.observe(REST_SPEED, {"speed": 1.0}, at=motion.rest)
    m.observe(REST_YAW_RATE, {"yaw rate": 1.0}, at=motion.rest)
    if known.bearing:
        m.observe(GAUGE, {"x": -path.y / r, "y": path.x / r}, at=np.arange(len(r)) == 0)
    return m


def _along(motion: Motion) -> dict[str, Number]:
    """Return the Jacobian of the level acceleration along the body: a cos(m) - v w sin(m), at m = 0."""
    _, left = motion.level
    return {"acceleration": 1.0, "mount": -left, "slip": -left}


def _sideways(motion: Motion) -> dict[str, Number]:
    """Return the Jacobian of the level acceleration to the left of the body: a sin(m) + v w cos(m), at m = 0."""
    forward, _ = motion.level
    return {"yaw rate": motion.path.v, "speed": motion.yaw_rate, "mount": forward, "slip": forward}


def _tilt(m: LinearModel, motion: Motion, imu: ImuModel) -> None:
    """Add roll and pitch: a constant lean, and waves over the distance travelled."""
    for axis in ("roll", "pitch"):
        m.state(f"{axis} lean", imu.lean_std)
        m.waves(f"{axis} rocking", imu.rocking_std, imu.rocking_m, np.roll(np.abs(motion.path.v), 1) * motion.dt)


def _tilted(x: Number, y: Number, z: Number) -> tuple[dict[str, Number], ...]:
    """Return the Jacobians of a level vector (x, y, z) in body axes by roll and pitch."""
    axes: tuple[dict[str, Number], ...] = ({"pitch": -np.asarray(z)}, {"roll": z}, {"pitch": x, "roll": -np.asarray(y)})
    return tuple({f"{angle} {part}": c for angle, c in axis.items() for part in ("lean", "rocking")} for axis in axes)


def _gyroscope(m: LinearModel, motion: Motion, imu: ImuModel, noise: Array) -> None:
    """Add the biases and the samples. Only the bias about z changes: the others tell of the tilt alone."""
    rates: tuple[dict[str, Number], ...] = (
        {"roll rocking/du": np.abs(motion.path.v), "pitch lean": -motion.yaw_rate, "pitch rocking": -motion.yaw_rate},
        {"pitch rocking/du": np.abs(motion.path.v), "roll lean": motion.yaw_rate, "roll rocking": motion.yaw_rate},
        {"yaw rate": 1.0, "gyro wander": 1.0},
    )
    m.waves("gyro wander", imu.gyro_wander_std, (30.0, 300.0), motion.dt)
    for axis, rate in zip("xyz", rates, strict=True):
        m.state(f"gyro bias {axis}", imu.gyro_bias_std)
        m.observe(noise, {**rate, f"gyro bias {axis}": 1.0})


def _accelerometer(m: LinearModel, motion: Motion, imu: ImuModel, noise: Array, sideways: bool) -> None:
    """Add bias and scale of each axis, and the samples. The scale of the upward axis is part of its bias."""
    forward, left = motion.level
    paths: tuple[Mapping[str, Number], ...] = (_along(motion), _sideways(motion), {})
    tilts = _tilted(forward, left, GRAVITY)
    scales: tuple[dict[str, Number], ...] = ({"acc scale x": forward}, {"acc scale y": left}, {})
    m.state("acc scale x", imu.acc_scale_std)
    m.state("acc scale y", imu.acc_scale_std)
    for axis, path, tilt, scale in zip("xyz", paths, tilts, scales, strict=True):
        m.state(f"acc bias {axis}", math.hypot(imu.acc_bias_std, imu.acc_scale_std * GRAVITY if axis == "z" else 0.0))
        if axis != "y" or sideways:
            m.observe(noise, {**path, **tilt, **scale, f"acc bias {axis}": 1.0})


def _magnetometer(m: LinearModel, motion: Motion, imu: ImuModel) -> None:
    """Add hard and soft iron and the samples. What soft iron makes of the constant vertical field is part of hard iron.

    The field's strength and dip are known. Turned by the mounting angle, the iron has the same distribution.
    """
    horizontal, down = imu.field_ut * math.cos(imu.dip_rad), imu.field_ut * math.sin(imu.dip_rad)
    x, y = horizontal * np.sin(motion.path.course), horizontal * np.cos(motion.path.course)
    tilts = _tilted(x, y, -down)
    yaws: tuple[Mapping[str, Number], ...] = ({"yaw": y}, {"yaw": -x}, {})
    shared = imu.soft_iron_std / math.sqrt(2.0)
    m.state("soft iron xx", imu.soft_iron_std)
    m.state("soft iron yy", imu.soft_iron_std)
    m.state("soft iron xy", shared)
    softs: tuple[dict[str, Number], ...] = (
        {"soft iron xx": x, "soft iron xy": y},
        {"soft iron yy": y, "soft iron xy": x},
        {},
    )
    vertical = (shared, shared, imu.soft_iron_std)
    for axis, yaw, tilt, soft, part in zip("xyz", yaws, tilts, softs, vertical, strict=True):
        m.state(f"hard iron {axis}", math.hypot(imu.hard_iron_std, part * down))
        m.observe(imu.mag_std, {**yaw, **tilt, **soft, f"hard iron {axis}": 1.0})
