"""Attitude from gyroscope and accelerometer: a quaternion complementary filter, compiled, one row per tag.

q = (w, x, y, z) turns body (x forward, y left, z up) into a level frame, z up, whose azimuth zero is arbitrary:
yaw is the integrated gyroscope and nothing else, so that no magnetic disturbance can turn it. `magnetometer`
finds where north lies in that frame.

Predict (Trawny & Roumeliotis 2005, eq. 99, mean rate over the step):  q <- q * exp((w - b) dt / 2)
Correct (explicit complementary filter, Mahony, Hamel & Pflimlin 2008, eq. 32, with accelerometer only):
  e = a/|a| x R(q)^T z,   q <- q * exp(k e / 2),   b <- b - k_i e
The gain is dt/tau. It is a running mean for the first second, short at confirmed rest, and long under motion. The
weight of a sample falls to nothing between 10 % and 20 % of deviation of |a| from the tag's own gravity (Valenti,
Dryanovski & Xiao 2015, eq. 60). Own gravity: cheap accelerometers read 5 % high.
A ramp of the speed and the centripetal acceleration of an arc last for seconds and look like a tilt. Once the tilt is
known, |e| is therefore bounded, so that an acceleration bends it no faster than a small tilt would, and a sample
teaches the size of gravity by the same weight as the tilt. The bound grows with the roughness of the ride: steps have
peaks on one side, and clipping these would shift their mean.

A tag that has not rested does not know the bias of its gyroscope, and k_i alone would take minutes to find it. A Kalman
filter of tilt error and bias (P += F P F^T + Q, then Joseph's form with the gains in use) therefore gives a larger gain
of the bias while that is unknown. Its measurement noise grows with the roughness of the ride, as the accelerations do.
"""

import math
from typing import Any, TypeAlias

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit

ATTITUDE = np.dtype(
    [
        ("q", "f8", 4),
        ("gyro", "f8", 3),  # last sample, rad/s, raw
        ("bias", "f8", 3),  # rad/s
        ("gravity", "f8"),  # |a| when nothing accelerates, m/s^2
        ("age", "f8"),  # s of accelerometer seen
        ("tilt_cov", "f8", 3),  # of tilt error and bias, about any level axis: rad^2, rad^2/s, (rad/s)^2
    ]
)
Attitude: TypeAlias = Any  # a record of ATTITUDE

TAU = 6.0  # s, of the tilt correction under motion
TAU_REST = 0.5  # s, at confirmed rest
TAU_BIAS = 40.0  # s, of the bias that tilt teaches
TAU_GRAVITY = 30.0  # s
SETTLE = 1.0  # s of running mean after switch-on
SETTLED = 2.0 * TAU  # s, age from which the tilt is known
TILT_SD = 0.045  # rad, of the tilt that the first samples give
LEVEL_BIAS_SD = 0.01  # rad/s, of the bias about a level axis: as much as tilt may teach
TILT_WALK, BIAS_WALK = 1e-5, 2e-9  # rad^2/s, (rad/s)^2/s
TILT_NOISE, TILT_NOISE_REST = 5e-3, 1e-3  # rad^2 s, of an accelerometer that says where up is
ROUGH_NOISE = 0.5  # rad^2 s per (m/s^2)^2 of roughness
BOUND = 0.1  # rad, of a deviation from a known tilt on a smooth ride
SHAKING = 2.0  # standard deviations of the acceleration that are added to it
GRAVITY_WEIGHT = 0.02  # least weight of a sample for the size of gravity, so that a wrong one is found again
FULL_WEIGHT, NO_WEIGHT = 0.1, 0.2  # relative deviation of |a|
NO_TIME = 1e-6  # s
VERTICAL = 0.01  # smallest cos^2 of pitch at which yaw still has a rate
SMALL_ANGLE = 0.04  # rad^2: below, two terms of the series are exact to 1e-9


@njit(cache=True, nogil=True)
def rotate_by(q: Array, x: float, y: float, z: float) -> None:
    """Rotate q by a small angle (x, y, z), rad, about body axes: q <- q * exp((x, y, z)/2). Keep |q| = 1."""
    s = 0.25 * (x * x + y * y + z * z)
    if s < SMALL_ANGLE:
        c = 1.0 - s * (0.5 - s / 24.0)
        k = 0.5 * (1.0 - s * (1.0 / 6.0 - s / 120.0))
    else:
        half = math.sqrt(s)
        c = math.cos(half)
        k = 0.5 * math.sin(half) / half
    x, y, z = k * x, k * y, k * z
    q0, q1, q2, q3 = q[0], q[1], q[2], q[3]
    w = c * q0 - x * q1 - y * q2 - z * q3
    i = c * q1 + x * q0 + z * q2 - y * q3
    j = c * q2 + y * q0 + x * q3 - z * q1
    l = c * q3 + z * q0 + y * q1 - x * q2  # noqa: E741
    n = 1.5 - 0.5 * (w * w + i * i + j * j + l * l)  # one Newton step to 1/|q|, which is 1 to 1e-7 here
    q[0], q[1], q[2], q[3] = w * n, i * n, j * n, l * n


@njit(cache=True, nogil=True)
def up_in_body(q: Array) -> tuple[float, float, float]:
    """Return the direction of up in the body frame: R(q)^T z."""
    return (
        2.0 * (q[1] * q[3] - q[0] * q[2]),
        2.0 * (q[2] * q[3] + q[0] * q[1]),
        1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]),
    )


@njit(cache=True, nogil=True)
def down_weight(deviation: float) -> float:
    """Return the weight of an accelerometer sample, 0 to 1, from the relative deviation of |a| from gravity."""
    return min(1.0, max(0.0, (NO_WEIGHT - abs(deviation)) / (NO_WEIGHT - FULL_WEIGHT)))


@njit(cache=True, nogil=True)
def level_attitude(q: Array, ax: float, ay: float, az: float) -> None:
    """Set q to the attitude with yaw 0 in which (ax, ay, az) points up."""
    n = math.sqrt(ax * ax + ay * ay + az * az)
    roll = math.atan2(ay, az)
    pitch = math.asin(max(-1.0, min(1.0, -ax / n)))
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    q[0], q[1], q[2], q[3] = cr * cp, sr * cp, cr * sp, -sr * sp


@njit(cache=True, nogil=True)
def predict_attitude(a: Attitude, dt: float, gyro: Array, rest: bool) -> None:
    """Predict over dt, s, with the mean of the last and this rate, rad/s. At confirmed rest only keep the rate."""
    if not rest:
        P = a.tilt_cov
        P[0] += 2.0 * P[1] * dt + P[2] * dt * dt + TILT_WALK * dt
        P[1] += P[2] * dt
        P[2] += BIAS_WALK * dt
        x = 0.5 * (a.gyro[0] + gyro[0]) - a.bias[0]
        y = 0.5 * (a.gyro[1] + gyro[1]) - a.bias[1]
        z = 0.5 * (a.gyro[2] + gyro[2]) - a.bias[2]
        rotate_by(a.q, x * dt, y * dt, z * dt)
    a.gyro[0], a.gyro[1], a.gyro[2] = gyro[0], gyro[1], gyro[2]


@njit(cache=True, nogil=True)
def update_tilt_cov(P: Array, variance: float, k: float, ki: float, rest: bool) -> float:
    """Update with a sample of this variance, rad^2, whose gain for the tilt is k.

    Return the gain for the bias: ki, or more while the bias is unknown. At rest the gyroscope tells it, and not a tilt.
    """
    tilt, cov, bias = P[0], P[1], P[2]
    ki = 0.0 if rest else max(ki, cov / (tilt + variance))
    P[0] = (1.0 - k) * (1.0 - k) * tilt + k * k * variance
    P[1] = (1.0 - k) * (cov - ki * tilt) + k * ki * variance
    P[2] = bias - 2.0 * ki * cov + ki * ki * (tilt + variance)
    return ki


@njit(cache=True, nogil=True)
def correct_tilt(
    a: Attitude, dt: float, ax: float, ay: float, az: float, rest: bool, roughness: float, tau: float = TAU
) -> float:
    """Correct with one accelerometer sample, m/s^2. roughness: its variance within tenths of a second, (m/s^2)^2.

    tau: s, under motion. Return the share of a deviation that was taken for tilt.
    """
    n = math.sqrt(ax * ax + ay * ay + az * az)
    if n < 1.0 or dt == 0.0:
        return 0.0
    if a.age == 0.0:
        a.gravity = n
    a.age += dt
    weight = down_weight(n / a.gravity - 1.0)
    tau_g = min(a.age, TAU_GRAVITY)
    a.gravity += max(weight, 1.0 if a.age < SETTLE else GRAVITY_WEIGHT) * dt / (tau_g + dt) * (n - a.gravity)
    if rest or SETTLE < a.age < TAU:
        a.age = max(a.age, SETTLED)  # from now on the tilt is known, and a deviation is motion
    ux, uy, uz = up_in_body(a.q)
    k = weight * dt / (min(a.age, TAU_REST if rest else tau) + dt)
    s = 1.0 / n
    ex, ey, ez = s * (ay * uz - az * uy), s * (az * ux - ax * uz), s * (ax * uy - ay * ux)
    scale = 1.0
    if a.age >= SETTLED and not rest:
        bound = BOUND + SHAKING * math.sqrt(roughness) / a.gravity
        scale = bound / max(math.sqrt(ex * ex + ey * ey + ez * ez), bound)
        ex, ey, ez = scale * ex, scale * ey, scale * ez
    rotate_by(a.q, k * ex, k * ey, k * ez)
    if a.age > SETTLE:
        ki = weight * dt / (tau * TAU_BIAS) if a.age > TAU else 0.0
        noise = TILT_NOISE_REST if rest else TILT_NOISE + ROUGH_NOISE * roughness
        ki = update_tilt_cov(a.tilt_cov, noise / max(weight * dt, NO_TIME), k, ki, rest)
        a.bias[0] -= ki * ex
        a.bias[1] -= ki * ey
        a.bias[2] -= ki * ez
    return k * scale  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def yaw_of(q: Array) -> float:
    """Return the azimuth of the body x axis, rad, counter-clockwise."""
    return math.atan2(2.0 * (q[1] * q[2] + q[0] * q[3]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]))


@njit(cache=True, nogil=True)
def yaw_rate_of(a: Attitude) -> float:
    """Return d yaw / dt, rad/s, from the last body rates: (q sin roll + r cos roll) / cos pitch."""
    q = a.q
    ux, uy, uz = up_in_body(q)
    rate = uy * (a.gyro[1] - a.bias[1]) + uz * (a.gyro[2] - a.bias[2])
    return rate / max(1.0 - ux * ux, VERTICAL)  # type: ignore[no-any-return]
