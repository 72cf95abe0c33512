"""Raw 9-axis samples of a tag. Body frame: x forward, y left, z up. Site frame: east, north, up.

The attitude is R_enu_from_body = Rz(yaw) Ry(pitch) Rx(roll). Accelerometers measure the specific force
Rᵀ (a + (0, 0, g)). Gyros measure the body rates of the Z-Y-X angles. Magnetometers measure A Rᵀ m + h, with the hard
iron h and the soft iron A.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dropanchor_tag_client.simulator.scalar import backward_rate, slow_drift
from dropanchor_tag_client.simulator.trajectory import Array, Trajectory

GRAVITY = 9.80665
ROCKING_WAVES = 6


class Imu(NamedTuple):
    """IMU samples: t_s (n,); acc m/s², gyro rad/s and mag µT, each (n, 3)."""

    t_s: Array
    acc: Array
    gyro: Array
    mag: Array


class Attitude(NamedTuple):
    """Z-Y-X angles of the body, each (n,), rad."""

    roll: Array
    pitch: Array
    yaw: Array


@dataclass(frozen=True)
class ImuModel:
    """A low-cost IMU on a wheeled vehicle.

    The …_std of biases, iron and scale describe the spread over units; `draw_unit` draws one. The defaults are typical
    of MEMS data sheets (noise, bias) and of mid-latitudes (field).

    hz: sample rate; None: one sample at every instant of the motion.
    rocking_std: roll and pitch from uneven ground, rad; a smooth function of the distance travelled with wavelengths
    `rocking_m`. lean_std: their constant part, rad.
    gyro_wander_std: standard deviation of a smooth change of the bias over minutes.
    gyro_drift: amplitude of a `slow_drift` about z.
    vibration_acc, vibration_gyro: added white noise; it grows linearly from 0 at rest to this value at 1 m/s.
    disturbances_per_min: rate of episodes that add a field of U(disturbance_ut), fixed in the site frame.
    field_ut, dip_rad, declination_rad: strength of the Earth's field, its angle below the horizon, and declination.
    """

    hz: float | None = None
    acc_std: float = 0.03
    acc_bias_std: float = 0.05
    acc_scale_std: float = 0.005
    gyro_std: float = 0.005
    gyro_bias_std: float = 0.01
    gyro_wander_std: float = 0.001
    gyro_drift: float = 0.0
    mag_std: float = 0.5
    hard_iron_std: float = 10.0
    soft_iron_std: float = 0.03
    rocking_std: float = 0.01
    rocking_m: tuple[float, float] = (3.0, 20.0)
    lean_std: float = 0.01
    vibration_acc: float = 0.3
    vibration_gyro: float = 0.02
    disturbances_per_min: float = 0.0
    disturbance_ut: tuple[float, float] = (5.0, 30.0)
    disturbance_s: tuple[float, float] = (2.0, 6.0)
    field_ut: float = 48.5
    dip_rad: float = math.radians(64.5)
    declination_rad: float = 0.0


class Waves(NamedTuple):
    """A smooth random function, as a sum of sines. amplitude, rate and phase: (k,)."""

    amplitude: Array
    rate: Array
    phase: Array

    def at(self, u: Array) -> Array:
        return np.sin(np.multiply.outer(u, self.rate) + self.phase) @ self.amplitude


@dataclass(frozen=True)
class ImuUnit:
    """One physical IMU, mounted on one tag, with its constant errors.

    The samples of consecutive stretches of one motion fit together. mount: course minus body yaw, rad.
    """

    model: ImuModel
    mount: float
    acc_scale: Array
    acc_bias: Array
    gyro_bias: Array
    wander: tuple[Waves, Waves, Waves]
    soft_iron: Array
    hard_iron: Array
    lean: Array
    rocking: tuple[Waves, Waves]
    seed: int

    def attitude(self, motion: Trajectory) -> Attitude:
        roll, pitch = (lean + waves.at(motion.travelled) for lean, waves in zip(self.lean, self.rocking, strict=True))
        return Attitude(roll, pitch, motion.course - self.mount)

    def measure(self, motion: Trajectory, rng: np.random.Generator, azimuth_error: Array | float = 0.0) -> Imu:
        """Return samples at every row except the first, which only gives the preceding state of the motion.

        azimuth_error: (n,) or a number, rad; the field makes the heading appear larger by this angle.
        """
        attitude = self.attitude(motion)
        exact = Imu(
            motion.t,
            specific_force(motion, self.mount, attitude),
            body_rates(attitude, motion.dt),
            into_body(attitude, self.field(motion.t, azimuth_error)),
        )
        return self.with_errors(exact, np.minimum(np.abs(motion.v), 1.0), rng)

    def with_errors(self, exact: Imu, moving: Array, rng: np.random.Generator) -> Imu:
        """Return `exact`, the samples of perfect sensors, with the errors of this unit and without the first row.

        moving: (n,), share of the vibration, from 0 at rest to 1.
        """
        model = self.model
        acc = exact.acc * self.acc_scale + self.acc_bias + _white(rng, model.acc_std, model.vibration_acc * moving)
        gyro = exact.gyro + self._gyro_error(exact.t_s) + _white(rng, model.gyro_std, model.vibration_gyro * moving)
        mag = exact.mag @ self.soft_iron.T + self.hard_iron + _white(rng, model.mag_std, 0.0 * moving)
        return Imu(exact.t_s[1:], acc[1:], gyro[1:], mag[1:])

    def _gyro_error(self, t: Array) -> Array:
        error = self.gyro_bias + np.column_stack([waves.at(t) for waves in self.wander])
        error[:, 2] += self.model.gyro_drift * slow_drift(t)
        return error

    def field(self, t: Array, azimuth_error: Array | float) -> Array:
        """Return the Earth's field and its disturbances in the site frame, (n, 3) µT."""
        azimuth = self.model.declination_rad + azimuth_error + np.zeros_like(t)
        horizontal = self.model.field_ut * math.cos(self.model.dip_rad)
        down = self.model.field_ut * math.sin(self.model.dip_rad)
        field = np.column_stack([horizontal * np.sin(azimuth), horizontal * np.cos(azimuth), np.full_like(t, -down)])
        return field + self._disturbance(t)

    def _disturbance(self, t: Array) -> Array:
        """Return the field of all disturbances, (n, 3) µT.

        Each minute has its own random numbers, from the unit's seed, so that consecutive stretches fit together.
        """
        field = np.zeros((len(t), 3))
        if not self.model.disturbances_per_min:
            return field
        for minute in range(max(0, int(t[0] // 60) - 1), int(t[-1] // 60) + 1):
            rng = np.random.default_rng([self.seed, minute])
            for _ in range(rng.poisson(self.model.disturbances_per_min)):
                first, length = 60.0 * (minute + rng.random()), rng.uniform(*self.model.disturbance_s)
                direction = rng.standard_normal(3)
                strength = rng.uniform(*self.model.disturbance_ut) / math.sqrt(float(direction @ direction))
                rise = np.clip((t - first) / length, 0.0, 1.0)
                field += strength * np.sin(math.pi * rise)[:, None] * direction
        return field


def draw_unit(model: ImuModel, mount: float, rng: np.random.Generator) -> ImuUnit:
    """Return one random unit of the model."""
    soft = model.soft_iron_std * rng.standard_normal((3, 3))
    return ImuUnit(
        model=model,
        mount=mount,
        acc_scale=1.0 + model.acc_scale_std * rng.standard_normal(3),
        acc_bias=model.acc_bias_std * rng.standard_normal(3),
        gyro_bias=model.gyro_bias_std * rng.standard_normal(3),
        wander=(_wander(model, rng), _wander(model, rng), _wander(model, rng)),
        soft_iron=np.eye(3) + (soft + soft.T) / 2,
        hard_iron=model.hard_iron_std * rng.standard_normal(3),
        lean=model.lean_std * rng.standard_normal(2),
        rocking=(_rocking(model, rng), _rocking(model, rng)),
        seed=int(rng.integers(2**31)),
    )


def specific_force(motion: Trajectory, mount: float, attitude: Attitude) -> Array:
    """Return the specific force Rᵀ (a + (0, 0, g)), (n, 3) m/s². a is the mean acceleration since the previous row."""
    forward, leftward = path_acceleration(motion)
    return untilted(attitude, turned(forward, leftward, np.full(len(motion), GRAVITY), mount))


def path_acceleration(motion: Trajectory) -> tuple[Array, Array]:
    """Return the mean acceleration since the previous row, along and to the left of the course, (n,) m/s²."""
    return backward_rate(motion.v, motion.dt), motion.v * backward_rate(motion.course, motion.dt)


def turned(forward: Array, leftward: Array, up: Array, mount: Array | float) -> Array:
    """Return a vector, given along, left of and above the course, in the level frame with the body's yaw, (n, 3).

    mount: course minus body yaw, rad.
    """
    cos, sin = np.cos(mount), np.sin(mount)
    return np.column_stack([cos * forward - sin * leftward, sin * forward + cos * leftward, up])


def body_rates(attitude: Attitude, dt: float) -> Array:
    """Return the mean angular rate since the previous row in body axes, from Z-Y-X angles, (n, 3) rad/s."""
    roll, pitch, _ = attitude
    d_roll, d_pitch, d_yaw = (backward_rate(angle, dt) for angle in attitude)
    return np.column_stack(
        [
            d_roll - d_yaw * np.sin(pitch),
            d_pitch * np.cos(roll) + d_yaw * np.cos(pitch) * np.sin(roll),
            -d_pitch * np.sin(roll) + d_yaw * np.cos(pitch) * np.cos(roll),
        ]
    )


def into_body(attitude: Attitude, vector: Array) -> Array:
    """Return Rᵀ vector, (n, 3): a vector of the site frame in body axes."""
    east, north, up = vector.T
    cos, sin = np.cos(attitude.yaw), np.sin(attitude.yaw)
    return untilted(attitude, np.column_stack([cos * east + sin * north, -sin * east + cos * north, up]))


def untilted(attitude: Attitude, level: Array) -> Array:
    """Return (Ry(pitch) Rx(roll))ᵀ level, (n, 3): from the level frame with the body's yaw to body axes."""
    x, y, z = level.T
    cos_p, sin_p, cos_r, sin_r = (f(a) for a in (attitude.pitch, attitude.roll) for f in (np.cos, np.sin))
    turned_x, turned_z = cos_p * x - sin_p * z, sin_p * x + cos_p * z
    return np.column_stack([turned_x, cos_r * y + sin_r * turned_z, -sin_r * y + cos_r * turned_z])


def quaternions(attitude: Attitude) -> Array:
    """Return the unit quaternions (w, x, y, z) body → ENU, (n, 4)."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(angle / 2), np.sin(angle / 2)) for angle in attitude)
    return np.column_stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def _white(rng: np.random.Generator, std: float, added_std: Array) -> Array:
    return np.hypot(std, added_std)[:, None] * rng.standard_normal((len(added_std), 3))


def _wander(model: ImuModel, rng: np.random.Generator) -> Waves:
    return draw_waves(rng, model.gyro_wander_std, (30.0, 300.0))


def _rocking(model: ImuModel, rng: np.random.Generator) -> Waves:
    return draw_waves(rng, model.rocking_std, model.rocking_m)


def draw_waves(rng: np.random.Generator, std: float, lengths: tuple[float, float]) -> Waves:
    """Return waves of random length (log-uniform) and phase. Their sum has the standard deviation `std`."""
    length = np.exp(rng.uniform(math.log(lengths[0]), math.log(lengths[1]), ROCKING_WAVES))
    amplitude = np.full(ROCKING_WAVES, std * math.sqrt(2.0 / ROCKING_WAVES))
    return Waves(amplitude, math.tau / length, rng.uniform(0.0, math.tau, ROCKING_WAVES))
