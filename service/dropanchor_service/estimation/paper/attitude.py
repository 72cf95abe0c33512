"""Attitude from gyroscope, accelerometer and magnetometer: the quaternion complementary filter of

    R. G. Valenti, I. Dryanovski, J. Xiao, "Keeping a Good Attitude: A Quaternion-Based Orientation Filter for IMUs
    and MARGs", Sensors 15(8), 2015, 19302-19330.

The state is q = (w, x, y, z), the rotation world_from_body with world = ENU (x east, y north, z up) and body = x
forward, y left, z up. Valenti's own quaternion is the inverse, body_from_world, of a world whose x axis points to
magnetic north; the equation numbers below are his. Plain tuples and `math`: one sample costs a few microseconds.

    predict   q <- q * exp(w dt / 2)                      w = gyro - bias                            (37-42, exact here)
    tilt      g = R(q) a/|a|;  q <- I(dq_acc(g), alpha) * q   dq_acc: shortest rotation of g to up   (44-53)
    yaw       l = R(q) m;      q <- I(dq_mag(l), beta) * q    dq_mag: about up, l to magnetic north  (54-59)
    bias      b <- b + gain (gyro - b)                    while the body stands still

I(dq, gain) is the interpolation between no correction and dq (48-52). The gain of the accelerometer fades out while
| |a| - g | / g grows from 10 % to 20 % (60-61). Gains are dt / time constant, so that the rate of the IMU does not
matter; 1 s is Valenti's gain of 0.01 at 100 Hz.
"""

import math
from dataclasses import dataclass

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)
STANDARD_GRAVITY = 9.80665  # m/s², by definition (CGPM 1901)
LERP_ABOVE = 0.9  # cosine of the half angle above which LERP replaces SLERP, Valenti's epsilon


@dataclass(frozen=True)
class AttitudeParameters:
    """Time constants in s. An infinite time constant leaves that correction out."""

    tilt_time: float = 1.0  # s; Valenti: gain 0.01 at 100 Hz
    yaw_time: float = 1.0  # s; the same; inf: the magnetometer is not used at all
    bias_time: float = 1.0  # s; gain 0.01 at 100 Hz, as in the filter's ROS package imu_complementary_filter
    acc_error_low: float = 0.1  # of | |a| - g | / g: below, the full gain (Valenti, section 4.4)
    acc_error_high: float = 0.2  # above, no correction
    still_acc: float = 0.1  # m/s², | |a| - g | of a body at rest (imu_complementary_filter)
    still_gyro: float = 0.2  # rad/s, |gyro - bias| per axis of a body at rest (imu_complementary_filter)
    still_change: float = 0.05  # rad/s, change per axis between samples of a body at rest (there 0.01; ours: noise)
    still_after: float = 0.5  # s at rest before the bias is learnt (ours: a slow turn looks like rest for a moment)
    longest_gap: float = 1.0  # s between samples, after which the rotation between them counts as unknown (ours)


def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return the Hamilton product p q: the rotation q, then p."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def normalised(q: Quaternion) -> Quaternion:
    """Return q / |q|."""
    w, x, y, z = q
    n = math.sqrt(w * w + x * x + y * y + z * z)
    return (w / n, x / n, y / n, z / n)


def rotate(q: Quaternion, v: Vector) -> Vector:
    """Return R(q) v = v + 2 u x (u x v + w v), with q = (w, u)."""
    w, x, y, z = q
    vx, vy, vz = v
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx)


def about_up(angle: float) -> Quaternion:
    """Return the rotation by `angle` rad about the z axis."""
    return (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))


def yaw(q: Quaternion) -> float:
    """Return the direction of the body's x axis, rad counter-clockwise from the world's x axis, in (-pi, pi]."""
    w, x, y, z = q
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def wrapped(angle: float) -> float:
    """Return the angle in [-pi, pi]."""
    return math.remainder(angle, math.tau)


def up_from(g: Vector) -> Quaternion:
    """Return the rotation of the unit vector g to (0, 0, 1): Valenti's quaternion from gravity (25), inverted.

    There are two forms, so that neither divides by a small number. For g_z >= 0 it is the shortest rotation.
    """
    x, y, z = g
    if z >= 0:
        s = math.sqrt(2 * (1 + z))
        return (s / 2, y / s, -x / s, 0.0)
    s = math.sqrt(2 * (1 - z))
    return (-y / s, -s / 2, 0.0, -x / s)


def rotation_by(v: Vector) -> Quaternion:
    """Return exp(v / 2): the rotation by |v| rad about v."""
    x, y, z = v
    angle = math.sqrt(x * x + y * y + z * z)
    half = 0.5 - angle * angle / 48 if angle < 1e-4 else math.sin(angle / 2) / angle
    return (math.cos(angle / 2), half * x, half * y, half * z)


def part_of(q: Quaternion, gain: float) -> Quaternion:
    """Return the share `gain` of the rotation q: LERP for small angles, else SLERP from the identity (48-52)."""
    w, x, y, z = q if q[0] >= 0 else (-q[0], -q[1], -q[2], -q[3])
    if w > LERP_ABOVE:
        return normalised((1 - gain + gain * w, gain * x, gain * y, gain * z))
    half = math.acos(w)
    share = math.sin(gain * half) / math.sin(half)
    return (math.cos(gain * half), share * x, share * y, share * z)


def acc_gain_factor(norm: float, low: float, high: float) -> float:
    """Return 1 while the specific force looks like gravity alone. It falls linearly to 0 as the error grows (60-61)."""
    error = abs(norm - STANDARD_GRAVITY) / STANDARD_GRAVITY
    return min(1.0, max(0.0, (high - error) / (high - low)))


class AttitudeFilter:
    """The attitude filter of one IMU.

    declination: true minus magnetic north, rad, positive east; magnetic north is pi/2 - declination from east.
    yaw_start: the yaw with which a 6-axis IMU starts, rad. NaN: unknown, and the yaw is then only relative. The first
    sample with a magnetic field sets the yaw in any case.
    """

    def __init__(self, parameters: AttitudeParameters, declination: float = 0.0, yaw_start: float = math.nan) -> None:
        self._p = parameters
        self._north = math.pi / 2 - declination
        self._magnetic = False  # whether the yaw was ever set from the field
        self._still = 0.0  # s at rest
        self._gyro: Vector = (0.0, 0.0, 0.0)  # of the last sample
        self._zero = yaw_start
        self.q: Quaternion | None = None  # world_from_body, none before the first usable sample
        self.bias: Vector = (0.0, 0.0, 0.0)  # of the gyroscope, rad/s

    @property
    def absolute(self) -> bool:
        """Return whether the yaw counts from east, and not from the first direction of the body."""
        return self.q is not None and (self._magnetic or math.isfinite(self._zero))

    @property
    def yaw(self) -> float:
        """Return the yaw in rad, NaN before the first usable sample."""
        return math.nan if self.q is None else yaw(self.q)

    def up_rate(self, gyro: Vector) -> float:
        """Return the turn rate about up, rad/s, of a gyroscope sample."""
        rate = (gyro[0] - self.bias[0], gyro[1] - self.bias[1], gyro[2] - self.bias[2])
        return rate[2] if self.q is None else rotate(self.q, rate)[2]

    def step(self, dt: float, acc: Vector, gyro: Vector, mag: Vector) -> None:
        """Update with one sample.

        dt: s since the previous sample, any value for the first. acc: m/s². gyro: rad/s. mag: any unit, NaN: no field.
        An acceleration near zero (free fall) or one that is not finite gives no tilt.
        """
        norm = math.sqrt(acc[0] * acc[0] + acc[1] * acc[1] + acc[2] * acc[2])
        up_seen = 1e-3 * STANDARD_GRAVITY < norm < math.inf
        up = (acc[0] / norm, acc[1] / norm, acc[2] / norm) if up_seen else None
        if self.q is not None and dt > self._p.longest_gap:
            self.q, self._magnetic, self._zero, self._still = None, False, math.nan, 0.0
        if self.q is None:
            self._start(up)
        else:
            self._learn_bias(dt, norm, gyro)
            self._predict(dt, gyro)
            if up is not None:
                self._correct_tilt(dt, up, norm)
        self._gyro = gyro
        self._correct_yaw(dt, mag)

    def _start(self, up: Vector | None) -> None:
        if up is None:
            return
        tilt = up_from(up)
        zero = self._zero if math.isfinite(self._zero) else 0.0
        self.q = multiply(about_up(zero - yaw(tilt)), tilt)

    def _predict(self, dt: float, gyro: Vector) -> None:
        assert self.q is not None
        bx, by, bz = self.bias
        turned = rotation_by(((gyro[0] - bx) * dt, (gyro[1] - by) * dt, (gyro[2] - bz) * dt))
        self.q = normalised(multiply(self.q, turned))

    def _correct_tilt(self, dt: float, up: Vector, norm: float) -> None:
        assert self.q is not None
        factor = acc_gain_factor(norm, self._p.acc_error_low, self._p.acc_error_high)
        gain = factor * min(1.0, dt / self._p.tilt_time)
        if gain > 0:
            self.q = normalised(multiply(part_of(up_from(rotate(self.q, up)), gain), self.q))

    def _correct_yaw(self, dt: float, mag: Vector) -> None:
        """Turn about up, until the field points to magnetic north. The first field counts in full."""
        if self.q is None or math.isinf(self._p.yaw_time):
            return
        x, y, _ = rotate(self.q, mag)
        if not 0 < x * x + y * y < math.inf:
            return
        gain = min(1.0, dt / self._p.yaw_time) if self._magnetic else 1.0
        correction = about_up(wrapped(self._north - math.atan2(y, x)))
        self.q = normalised(multiply(part_of(correction, gain), self.q))
        self._magnetic = True

    def _learn_bias(self, dt: float, acc_norm: float, gyro: Vector) -> None:
        p = self._p
        still = abs(acc_norm - STANDARD_GRAVITY) < p.still_acc and all(
            abs(w - b) < p.still_gyro and abs(w - last) < p.still_change
            for w, b, last in zip(gyro, self.bias, self._gyro, strict=True)
        )
        self._still = self._still + dt if still else 0.0
        if self._still > p.still_after:
            gain = min(1.0, dt / p.bias_time)
            bx, by, bz = self.bias
            self.bias = (bx + gain * (gyro[0] - bx), by + gain * (gyro[1] - by), bz + gain * (gyro[2] - bz))
