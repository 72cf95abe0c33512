"""The Kalman filter of the magnetic field in the gyroscope's level frame, and of the magnetometer's own hard iron.

Model, linear in field f (level frame) and hard iron h (body frame), with R from `attitude` (body -> level):
  m = R^T f + h + v
State x = (f, h, b, s): the level frame itself turns slowly about the vertical, by phi = b dt + s dyaw, because the
gyroscope has a residual bias b (rad/s) and scale error s; then f <- R_z(phi) f, which makes b and s observable. A
Kalman filter with f ~ N(0, l^2), h ~ N(0, (hard_iron l)^2), l = |m| of the first sample, so the
unit of the magnetometer does not matter. On a level track soft iron looks like distortion by the place; it stays in v.

v is the distortion of the field by the place; its size r is learned (`magnetometer`). Where r is small the field is
clean, so f and h wander less, too.
"""

import math
from typing import Any, TypeAlias

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.preintegration import GYRO_SCALE

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
        ("changed", "u1"),  # 1: a sudden change has disturbed it
        ("last_m", "f8", 3),  # last undisturbed mean, field units
        ("last_R", "f8", (3, 3)),  # and its attitude, body -> level
        ("since_last", "f8"),  # s from then until the next mean; 0: there is none
        ("yaw", "f8"),  # rad, of the level frame at the last update
        ("elapsed", "f8"),  # s since the last update
        ("count", "f8"),  # samples in the sums
        ("sum_m", "f8", 3),
        ("sum_R", "f8", (3, 3)),  # body -> level
    ]
)
Magnetometer: TypeAlias = Any  # a record of MAGNETOMETER

NOISE = 0.15  # of the unit: first value of r
NOISE_PRIOR = 2.0  # s: what it counts for
FIELD_WALK = 0.013  # of r, per sqrt(s)
IRON_WALK = 0.02  # of r, per sqrt(s): motors near by
YAW_WALK = 1e-6  # rad^2/s, the gyroscope's white noise
BIAS_SD = 1.5e-3  # rad/s, of what rest has left
BIAS_WALK = 1e-10  # (rad/s)^2/s


@njit(cache=True, nogil=True)
def start_magnetometer(g: Magnetometer, mx: float, my: float, mz: float, hard_iron: float, bias_var: float) -> None:
    """Set unit and prior from the first sample. bias_var: (rad/s)^2, of the gyroscope's bias about the vertical."""
    g.unit = math.sqrt(mx * mx + my * my + mz * mz)
    u2 = g.unit * g.unit
    g.x[:] = 0.0
    g.P[:] = 0.0
    for i in range(3):
        g.P[i, i] = u2
        g.P[3 + i, 3 + i] = hard_iron * hard_iron * u2
        g.noise[i] = NOISE * NOISE * u2
    g.P[BIAS, BIAS] = BIAS_SD * BIAS_SD + bias_var
    g.P[SCALE, SCALE] = GYRO_SCALE * GYRO_SCALE
    g.age = NOISE_PRIOR
    g.changed = 0
    g.since_last = g.elapsed = g.count = 0.0
    g.sum_m[:] = 0.0
    g.sum_R[:] = 0.0


@njit(cache=True, nogil=True)
def forget_turning(g: Magnetometer, bias_var: float) -> None:
    """Let the bias of the gyroscope be one that a rest has just told, with this variance, (rad/s)^2."""
    g.x[BIAS] = 0.0
    for i in range(N):
        g.P[BIAS, i] = g.P[i, BIAS] = 0.0
    g.P[BIAS, BIAS] = BIAS_SD * BIAS_SD + bias_var


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
def level_noise(g: Magnetometer) -> float:
    """Return r^2 of the two axes that are mostly level, field units squared."""
    return 0.5 * (g.noise[0] + g.noise[1])  # type: ignore[no-any-return]


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
    q = dt * min(level_noise(g), g.unit * g.unit)
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
