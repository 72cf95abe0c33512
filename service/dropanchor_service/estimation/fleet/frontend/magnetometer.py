"""Where magnetic north lies in the gyroscope's level frame, with the magnetometer's own hard iron unknown.

Model, linear in field f (level frame) and hard iron h (body frame), with R from `attitude` (body -> level):
  m = R^T f + h + v
State x = (f, h, b, s): the level frame itself turns slowly about the vertical, by phi = b dt + s dyaw, because the
gyroscope has a residual bias b (rad/s) and scale error s; then f <- R_z(phi) f, which makes b and s observable. A
Kalman filter with f ~ N(0, l^2), h ~ N(0, (hard_iron l)^2), l = |m| of the first sample, so the
unit of the magnetometer does not matter. On a level track soft iron looks like distortion by the place; it stays in v.

v is the distortion of the field by the place. It is correlated along the path (a few seconds at walking speed) and
constant at rest. Its variance is therefore inflated by 2 tau / dt, and a resting tag teaches nothing after its first
seconds. Its size r is learned per body axis, as the running mean square of the residuals of undisturbed samples.

A disturbance is an innovation far beyond r and the uncertainty of the state. The test covers all three components of
the field, because the gyroscope knows the heading. A disturbed sample is not used: the heading is then the
gyroscope's, and its variance grows. A disturbance that lasts is taken for a new field.
"""

import math
from typing import Any, TypeAlias

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.attitude import yaw_of

N = 8
BIAS, SCALE = 6, 7
MAGNETOMETER = np.dtype(
    [
        ("x", "f8", N),
        ("P", "f8", (N, N)),
        ("noise", "f8", 3),  # r^2 per body axis, field units squared
        ("unit", "f8"),  # |m| of the first sample; 0: none yet
        ("age", "f8"),  # s of field seen in motion, up to a limit
        ("nis", "f8"),  # normalised innovation squared, largest of late
        ("disturbed", "f8"),  # s for which it has been disturbed
        ("yaw", "f8"),  # rad, of the level frame at the last update
        ("elapsed", "f8"),  # s since the last update
        ("count", "f8"),  # samples in the sums
        ("sum_m", "f8", 3),
        ("sum_R", "f8", (3, 3)),  # body -> level
    ]
)
Magnetometer: TypeAlias = Any  # a record of MAGNETOMETER

PERIOD = 0.0999  # s between updates; samples between are averaged
CORRELATION = 4.0  # s
NOISE, NOISE_FLOOR = 0.15, 0.02  # of the unit
NOISE_TAU = 20.0  # s
NOISE_PRIOR = 5.0  # s: what the first value of r counts for
FIELD_WALK = 2e-3  # of the unit, per sqrt(s)
IRON_WALK = 3e-3  # of the unit, per sqrt(s): motors near by
YAW_WALK = 1e-6  # rad^2/s, the gyroscope's white noise
BIAS_SD = 1.5e-3  # rad/s, of what rest has left
SCALE_SD = 7e-3
BIAS_WALK = 1e-10  # (rad/s)^2/s
GATE = 5.0  # 15 for three axes: 1 in 500 by chance
STRAIN_TAU = 1.0  # s
GIVE_UP = 30.0  # s of disturbance that make a new field
REST_LEARNING = 3.0  # s


@njit(cache=True, nogil=True)
def start_magnetometer(g: Magnetometer, mx: float, my: float, mz: float, hard_iron: float) -> None:
    """Set unit and prior from the first sample."""
    g.unit = math.sqrt(mx * mx + my * my + mz * mz)
    u2 = g.unit * g.unit
    g.x[:] = 0.0
    g.P[:] = 0.0
    for i in range(3):
        g.P[i, i] = u2
        g.P[3 + i, 3 + i] = hard_iron * hard_iron * u2
        g.noise[i] = NOISE * NOISE * u2
    g.P[BIAS, BIAS] = BIAS_SD * BIAS_SD
    g.P[SCALE, SCALE] = SCALE_SD * SCALE_SD
    g.age = NOISE_PRIOR


@njit(cache=True, nogil=True)
def spread_yaw(g: Magnetometer, variance: float) -> None:
    """Add a variance of the level frame's yaw, rad^2: f gains it along its own tangent."""
    tx, ty = -g.x[1], g.x[0]
    g.P[0, 0] += variance * tx * tx
    g.P[0, 1] += variance * tx * ty
    g.P[1, 0] += variance * tx * ty
    g.P[1, 1] += variance * ty * ty


@njit(cache=True, nogil=True)
def spread_yaw_on_arc(g: Magnetometer, variance: float) -> None:
    """Add the variance, rad^2, of an unobserved turn of any size: f may lie anywhere on an arc.

    Along the tangent alone only another hard iron could explain a turn by a right angle.
    """
    keeps = math.exp(-0.5 * variance)  # mean cosine of a turn ~ N(0, variance)
    cos2, sin2 = 0.5 * (1.0 + math.exp(-2.0 * variance)), 0.5 * (1.0 - math.exp(-2.0 * variance))
    fx, fy, P = g.x[0], g.x[1], g.P
    radial, tangential = cos2 - keeps * keeps, sin2
    xx, xy, yy = P[0, 0], P[0, 1], P[1, 1]
    for j in range(2, N):
        for i in range(2):
            P[i, j] *= keeps
            P[j, i] = P[i, j]
    P[0, 0] = cos2 * xx + sin2 * yy + radial * fx * fx + tangential * fy * fy
    P[1, 1] = cos2 * yy + sin2 * xx + radial * fy * fy + tangential * fx * fx
    P[0, 1] = P[1, 0] = (cos2 - sin2) * xy + (radial - tangential) * fx * fy
    g.x[0], g.x[1] = keeps * fx, keeps * fy


@njit(cache=True, nogil=True)
def predict_field(g: Magnetometer, dt: float, dyaw: float) -> None:
    """Predict over dt, s: f turns by phi = b dt + s dyaw."""
    phi = g.x[BIAS] * dt + g.x[SCALE] * dyaw
    c, s = math.cos(phi), math.sin(phi)
    g.x[0], g.x[1] = c * g.x[0] - s * g.x[1], s * g.x[0] + c * g.x[1]
    tx, ty = -g.x[1], g.x[0]
    P = g.P
    for j in range(N):
        turned = dt * P[BIAS, j] + dyaw * P[SCALE, j]
        P[0, j], P[1, j] = c * P[0, j] - s * P[1, j] + tx * turned, s * P[0, j] + c * P[1, j] + ty * turned
    for i in range(N):
        turned = dt * P[i, BIAS] + dyaw * P[i, SCALE]
        P[i, 0], P[i, 1] = c * P[i, 0] - s * P[i, 1] + tx * turned, s * P[i, 0] + c * P[i, 1] + ty * turned
    q = dt * g.unit * g.unit
    for i in range(3):
        P[i, i] += FIELD_WALK * FIELD_WALK * q
        P[3 + i, 3 + i] += IRON_WALK * IRON_WALK * q
    P[BIAS, BIAS] += BIAS_WALK * dt
    spread_yaw(g, YAW_WALK * dt)


@njit(cache=True, nogil=True)
def innovation(g: Magnetometer, R: Array, m: Array, axis: int) -> float:
    """Return m - (R^T f + h) of one body axis."""
    x = g.x
    return m[axis] - R[0, axis] * x[0] - R[1, axis] * x[1] - R[2, axis] * x[2] - x[3 + axis]  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def project(P: Array, R: Array, axis: int, i: int) -> float:
    """Return row i of P times H^T of one body axis."""
    return P[i, 0] * R[0, axis] + P[i, 1] * R[1, axis] + P[i, 2] * R[2, axis] + P[i, 3 + axis]  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def predicted_variance(g: Magnetometer, R: Array, axis: int) -> float:
    """Return H P H^T of one body axis."""
    s = project(g.P, R, axis, 3 + axis)
    for i in range(3):
        s += R[i, axis] * project(g.P, R, axis, i)
    return s


@njit(cache=True, nogil=True)
def mean_nis(g: Magnetometer, R: Array, m: Array) -> float:
    """Return the mean over the axes of squared innovation over variance, without the inflation for correlation."""
    total = 0.0
    for axis in range(3):
        e = innovation(g, R, m, axis)
        total += e * e / (predicted_variance(g, R, axis) + g.noise[axis])
    return total / 3.0


@njit(cache=True, nogil=True)
def fuse_axis(g: Magnetometer, R: Array, m: Array, axis: int, inflation: float) -> None:
    """Update with one body axis, as a scalar."""
    P = g.P
    e = innovation(g, R, m, axis)
    k = (
        project(P, R, axis, 0),
        project(P, R, axis, 1),
        project(P, R, axis, 2),
        project(P, R, axis, 3),
        project(P, R, axis, 4),
        project(P, R, axis, 5),
        project(P, R, axis, BIAS),
        project(P, R, axis, SCALE),
    )
    S = R[0, axis] * k[0] + R[1, axis] * k[1] + R[2, axis] * k[2] + k[3 + axis] + inflation * g.noise[axis]
    for i in range(N):
        gain = k[i] / S
        g.x[i] += gain * e
        for j in range(i + 1):
            P[i, j] -= gain * k[j]
            P[j, i] = P[i, j]


@njit(cache=True, nogil=True)
def is_disturbed(g: Magnetometer, dt: float, strain: float) -> bool:
    """Return whether the sample is disturbed. A long disturbance makes field and hard iron unknown again."""
    decayed = g.nis * math.exp(-dt / STRAIN_TAU)
    g.nis = max(strain, decayed)
    if g.nis <= GATE:
        g.disturbed = 0.0
        return False
    g.disturbed += dt
    if g.disturbed > GIVE_UP:
        for i in range(6):
            g.P[i, i] += g.unit * g.unit
        g.disturbed = 0.0
        g.nis = 0.0
    return True


@njit(cache=True, nogil=True)
def update_noise(g: Magnetometer, R: Array, m: Array, dt: float) -> None:
    """Update r^2 with the squared residuals."""
    g.age = min(g.age + dt, NOISE_TAU)
    floor = NOISE_FLOOR * g.unit
    for axis in range(3):
        e = innovation(g, R, m, axis)
        g.noise[axis] += dt / g.age * (max(e * e, floor * floor) - g.noise[axis])


@njit(cache=True, nogil=True)
def add_to_sums(g: Magnetometer, q: Array, mx: float, my: float, mz: float) -> None:
    """Add one sample to the sums. m = R^T f + h is linear in R, so the means over a short time satisfy it, too."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    S = g.sum_R
    S[0, 0] += 1.0 - 2.0 * (y * y + z * z)
    S[0, 1] += 2.0 * (x * y - w * z)
    S[0, 2] += 2.0 * (x * z + w * y)
    S[1, 0] += 2.0 * (x * y + w * z)
    S[1, 1] += 1.0 - 2.0 * (x * x + z * z)
    S[1, 2] += 2.0 * (y * z - w * x)
    S[2, 0] += 2.0 * (x * z - w * y)
    S[2, 1] += 2.0 * (y * z + w * x)
    S[2, 2] += 1.0 - 2.0 * (x * x + y * y)
    g.sum_m[0] += mx
    g.sum_m[1] += my
    g.sum_m[2] += mz
    g.count += 1.0


@njit(cache=True, nogil=True)
def fuse(g: Magnetometer, dt: float, rest: bool) -> None:
    """Update with the mean of the samples since the last update, dt s ago. The sums become these means."""
    R, m = g.sum_R, g.sum_m
    for i in range(3):
        m[i] /= g.count
        for j in range(3):
            R[i, j] /= g.count
    if rest and g.age > NOISE_PRIOR + REST_LEARNING:
        return
    if is_disturbed(g, dt, mean_nis(g, R, m)):
        return
    first = g.age == NOISE_PRIOR
    inflation = 1.0 if first else max(1.0, 2.0 * CORRELATION / dt)
    for axis in range(3):
        fuse_axis(g, R, m, axis, inflation)
    update_noise(g, R, m, dt)


@njit(cache=True, nogil=True)
def update_magnetometer(g: Magnetometer, dt: float, q: Array, mag: Array, rest: bool, hard_iron: float) -> None:
    """Take one IMU sample, after the attitude. `mag` is NaN where there is no sample of the field."""
    known = math.isfinite(mag[0] + mag[1] + mag[2])
    if g.unit == 0.0:
        if not known or mag[0] == mag[1] == mag[2] == 0.0:
            return
        start_magnetometer(g, mag[0], mag[1], mag[2], hard_iron)
        g.yaw = yaw_of(q)
    g.elapsed += dt
    if known:
        add_to_sums(g, q, mag[0], mag[1], mag[2])
    if g.elapsed < PERIOD or g.count == 0.0:
        return
    yaw = yaw_of(q)
    dyaw = wrap(yaw - g.yaw)
    if not rest:
        predict_field(g, g.elapsed, dyaw)
    fuse(g, g.elapsed, rest)
    g.yaw = yaw
    g.elapsed = 0.0
    g.count = 0.0
    g.sum_m[:] = 0.0
    g.sum_R[:] = 0.0


@njit(cache=True, nogil=True)
def north_of(g: Magnetometer) -> tuple[float, float]:
    """Return the azimuth of magnetic north in the level frame, rad, and its variance, rad^2."""
    x, y = g.x[0], g.x[1]
    n2 = x * x + y * y
    if n2 == 0.0:
        return 0.0, math.inf
    variance = (y * y * g.P[0, 0] - 2.0 * x * y * g.P[0, 1] + x * x * g.P[1, 1]) / (n2 * n2)
    return math.atan2(y, x), variance
