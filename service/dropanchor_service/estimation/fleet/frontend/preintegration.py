"""The IMU between two ranges, pre-integrated: the pose belief predicts with it.

Yaw psi and the velocity integral V = int (R a)_xy dt live in the level frame of `attitude`; gravity has no horizontal
part there. A node is a difference of psi and V between its two ends, so nothing is counted twice wherever
the ranges fall. A range comes between two IMU samples: both ends are extrapolated with the last rates, by HORIZON at
most. dv is in the body-yaw frame at the start of the node.
Accelerations are scaled to the tag's own gravity (cheap accelerometers read 5 % high).

Roughness is what varies within tenths of a second. A vehicle that speeds up and brakes with every sample varies, too,
but along one direction, and that is no error of its speed. It is told by the covariance of the horizontal part in the
body-yaw frame: the difference of its eigenvalues.
"""

import math
from typing import Any, TypeAlias

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.frontend.standstill import Standstill

PREINTEGRATION = np.dtype(
    [
        ("V", "f8", 2),  # m/s, level frame
        ("a", "f8", 2),  # m/s^2, last horizontal acceleration, level frame
        ("acc_var", "f8"),  # (m/s^2)^2, variance of the acceleration within tenths of a second, slowly averaged
        ("shaking", "f8", 3),  # (m/s^2)^2, of it forward, forward times left, and left
        ("yaw_rate", "f8"),  # rad/s, last
        ("yaw_end", "f8"),  # rad, where the last node ended
        ("V_end", "f8", 2),
        ("gap_s", "f8"),  # s without usable IMU since the last node
        ("extrapolated_s", "f8"),  # s since the last IMU sample that earlier nodes have already counted as silent
        ("tilt_gain", "f8"),  # share of the acceleration that the tilt took for gravity since the last node, in motion
        ("no_acc_s", "f8"),  # s without usable accelerometer since the last node
    ]
)
Preintegration: TypeAlias = Any  # a record of PREINTEGRATION

G0 = 9.80665  # m/s^2
HORIZON = 0.1  # s
GYRO_NOISE = 4e-6  # rad^2/s: 0.02 rad/s white at 100 Hz
GYRO_SCALE = 7e-3  # of the turn, error of the gyroscope's scale
UNOBSERVED_RATE = 1.0  # rad/s, sd of the rate of a tag whose IMU is silent
ACC_FLOOR = 2e-4  # (m/s)^2/s
ACC_ROUGH = 0.03  # s: what of the roughness leaks into the integral, measured on recordings
ROUGH_TAU = 3.0  # s
ONE_WAY = 0.95  # share of the roughness along one direction, up to which the rest is doubtful
NO_DIRECTION = 1e-6  # cosine of the pitch, at least
ROUGH_GROWTH, ROUGH_START = 4.0, 0.1  # a sample counts for so many times the roughness plus this, (m/s^2)^2, at most
UNOBSERVED_ACC = 1.0  # m/s^2, sd of the acceleration of a tag whose IMU is silent


@njit(cache=True, nogil=True)
def unobserved_turn_var(s: float) -> float:
    """Return the variance, rad^2, of the turn in s seconds without a gyroscope. A rate lasts about a second."""
    return UNOBSERVED_RATE * UNOBSERVED_RATE * s * max(s, 1.0)


@njit(cache=True, nogil=True)
def unobserved_speed_var(s: float) -> float:
    """Return the variance, (m/s)^2, of the change of speed in s seconds without an accelerometer."""
    return UNOBSERVED_ACC * UNOBSERVED_ACC * s * max(s, 1.0)


@njit(cache=True, nogil=True)
def horizontal_of(q: Array, x: float, y: float, z: float) -> tuple[float, float]:
    """Return the horizontal part of a vector in the body frame, in the level frame of q."""
    w, i, j, k = q[0], q[1], q[2], q[3]
    return (
        (1.0 - 2.0 * (j * j + k * k)) * x + 2.0 * (i * j - w * k) * y + 2.0 * (i * k + w * j) * z,
        2.0 * (i * j + w * k) * x + (1.0 - 2.0 * (i * i + k * k)) * y + 2.0 * (j * k - w * i) * z,
    )


@njit(cache=True, nogil=True)
def add_shaking(p: Preintegration, share: float, q: Array, deviation: Array, bound: float) -> None:
    """Average the covariance of a deviation of the acceleration, m/s^2 in the body frame, in the body-yaw frame."""
    ahead_x, ahead_y = horizontal_of(q, 1.0, 0.0, 0.0)
    norm = max(math.hypot(ahead_x, ahead_y), NO_DIRECTION)
    u, v = horizontal_of(q, deviation[0], deviation[1], deviation[2])
    forward, left = (ahead_x * u + ahead_y * v) / norm, (ahead_x * v - ahead_y * u) / norm
    scale = bound / max(forward * forward + left * left, bound)
    p.shaking[0] += share * (scale * forward * forward - p.shaking[0])
    p.shaking[1] += share * (scale * forward * left - p.shaking[1])
    p.shaking[2] += share * (scale * left * left - p.shaking[2])


@njit(cache=True, nogil=True)
def add_acceleration(p: Preintegration, dt: float, q: Array, acc: Array, gravity: float, s: Standstill) -> None:
    """Add dt of acceleration by the trapezoidal rule. q: attitude at the end of dt.

    The variance is bounded: half a second of a turn or ramp varies a hundred times more than a smooth ride, and
    is no roughness. Roughness that stays is found within a second.
    """
    bound = ROUGH_GROWTH * p.acc_var + ROUGH_START
    p.acc_var += dt / (ROUGH_TAU + dt) * (min(s.acc_var, bound) - p.acc_var)
    add_shaking(p, dt / (ROUGH_TAU + dt), q, s.deviation, bound)
    k = G0 / gravity
    u, v = horizontal_of(q, k * acc[0], k * acc[1], k * acc[2])
    p.V[0] += 0.5 * dt * (p.a[0] + u)
    p.V[1] += 0.5 * dt * (p.a[1] + v)
    p.a[0], p.a[1] = u, v


@njit(cache=True, nogil=True)
def motion_in(p: Preintegration) -> float:
    """Return what of the roughness is motion of the vehicle, (m/s^2)^2: `ONE_WAY` of it at most, unless more is.

    The horizontal covariance cuts large samples more than `acc_var` does, so that share comes from its shape.
    """
    one_way = math.hypot(p.shaking[0] - p.shaking[2], 2.0 * p.shaking[1])
    both = p.shaking[0] + p.shaking[2]
    if one_way > ONE_WAY * both:
        return p.acc_var * one_way / both  # type: ignore[no-any-return]
    return min(one_way, ONE_WAY * p.acc_var)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def end_node(p: Preintegration, yaw: float, ahead: float, dt: float, node: Node) -> float:
    """Fill dyaw and dv of a node that lasts dt and ends `ahead` s after the last IMU sample. Return psi at its end."""
    reach = min(ahead, HORIZON)
    end = yaw + p.yaw_rate * reach
    vx, vy = p.V[0] + p.a[0] * reach, p.V[1] + p.a[1] * reach
    node.dyaw = wrap(end - p.yaw_end)
    dx, dy = vx - p.V_end[0], vy - p.V_end[1]
    c, s = math.cos(p.yaw_end), math.sin(p.yaw_end)
    node.dv_forward = c * dx + s * dy
    node.dv_left = c * dy - s * dx
    beyond = max(0.0, ahead - HORIZON)
    gap_s = p.gap_s + max(0.0, beyond - p.extrapolated_s)
    p.extrapolated_s = max(p.extrapolated_s, beyond)
    node.unobserved_s = gap_s
    node.tilt_gain = p.tilt_gain
    node.dyaw_var = GYRO_NOISE * dt + (GYRO_SCALE * node.dyaw) ** 2 + unobserved_turn_var(gap_s)
    node.dv_var = (
        math.inf if p.no_acc_s > 0.0 else (ACC_FLOOR + ACC_ROUGH * p.acc_var) * dt + unobserved_speed_var(gap_s)
    )
    node.motion_var = ACC_ROUGH * motion_in(p) * dt
    p.yaw_end = wrap(end)
    p.V_end[0], p.V_end[1] = vx, vy
    p.gap_s = p.no_acc_s = p.tilt_gain = 0.0
    return end  # type: ignore[no-any-return]
