"""Predict one hypothesis over a node: constant-course step in polar coordinates.

With w = dyaw - b_g dt, m = mount + slip, c = m + w/2, alpha = yaw + c - phi, f = dv_forward cos c + dv_left sin c
- b_a dt and d = v dt + f dt/2, and with the displacement g by a lever (forward, left), turned by yaw - phi:

    z = (r + d cos alpha, d sin alpha) + R(yaw - phi) g,  r' = |z|,  phi' = phi + atan2(z_y, z_x),
    yaw' = yaw + w,  v' = v + f,  slip, b_a and the reference error decay with their time constants.

dv is in the frame at the start of the node. A turn at constant speed v has dv = v (cos w - 1, sin w) there, which is at
right angles to the course in the middle of the node: only along that course does it leave the speed unchanged.
"""

import math
from typing import Any

from dropanchor_service.estimation.fleet.belief.heading_models import class_reference_error, reference_error
from dropanchor_service.estimation.fleet.belief.heading_reference import follow_reference
from dropanchor_service.estimation.fleet.belief.layout import (
    ACC_BIAS,
    GAIT_OFFSET,
    GYRO_BIAS,
    LEFT_BIAS,
    MAGNETOMETER_MODEL,
    MOUNT,
    PHI,
    RANGE_BIAS,
    REFERENCE,
    SLIP,
    STEP_SCALE,
    YAW,
    Floats,
    N,
    R,
    Row,
    Scratch,
    V,
)
from dropanchor_service.estimation.fleet.belief.rigidity import slip_std_of
from dropanchor_service.estimation.fleet.belief.tilt import follow_tilt, tilting_growth
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import ABSOLUTE_HEADING, MEASURED_HEADING, NO_HEADING, Node
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def is_empty(node: Node) -> bool:
    """Return whether no time passed since the node before: a range came with the IMU sample that ended it."""
    return bool(node.dt_s == 0.0 and node.dyaw == 0.0 and node.dyaw_var == 0.0 and node.dv_forward == 0.0)


@njit(nogil=True, borrows=True)
def predict(
    s: Floats, P: Floats, scratch: Scratch, node: Node, row: Row, t: Tuning, nlos: int, bends: bool, rigid: bool
) -> None:
    """Predict a state and its covariance over the node: the one motion model of the filter and of the smoother.

    scratch: with what `fill_noise` and `fill_class_noise` fill. bends: of `bends_tilt`.
    """
    F = scratch.F
    predict_state(s, node, scratch.decay, F)
    predict_covariance(P, F, scratch.decay, scratch.FP)
    add_process_noise(s, P, F, scratch.growth, node, row, t, nlos)
    if bends:
        follow_tilt(s, P, node, rigid, t)


@njit(nogil=True, inline="never")
def predict_state(s: Floats, node: Node, decay: Floats, F: Floats) -> None:
    """Predict the state s (N,) over the node, and fill F (4, N) with d(r, phi, yaw, v)'/ds before any decay.

    F must be zero or from an earlier call: entries that are always zero are not written.
    """
    dt = node.dt_s
    w = node.dyaw - s[GYRO_BIAS] * dt
    m = s[MOUNT] + s[SLIP]
    f, f_m, f_b = _speed_change(m + w / 2, s[ACC_BIAS], node)
    d = s[V] * dt + f * dt / 2
    alpha = s[YAW] + w / 2 + m - s[PHI]
    ca, sa = math.cos(alpha), math.sin(alpha)
    sx, sy = _swing(s[YAW] - s[PHI], node)
    zx, zy = s[R] + d * ca + sx, d * sa + sy
    r = max(math.sqrt(zx * zx + zy * zy), 1e-6)
    r_alpha, r_d = (-zx * d * sa + zy * d * ca) / r, (zx * ca + zy * sa) / r
    p_alpha, p_d = (zx * d * ca + zy * d * sa) / r**2, (zx * sa - zy * ca) / r**2
    r_beta, p_beta = (zy * sx - zx * sy) / r, (zx * sx + zy * sy) / r**2
    F[0, R], F[1, R] = zx / r, -zy / r**2
    F[0, PHI], F[1, PHI] = -r_alpha - r_beta, 1.0 - p_alpha - p_beta
    _fill_motion(F, 0, r_alpha, r_d, r_beta, dt, f_m, f_b)
    _fill_motion(F, 1, p_alpha, p_d, p_beta, dt, f_m, f_b)
    F[2, YAW], F[2, GYRO_BIAS] = 1.0, -dt
    F[3, V], F[3, MOUNT], F[3, SLIP], F[3, GYRO_BIAS], F[3, ACC_BIAS] = 1.0, f_m, f_m, -f_m * dt / 2, f_b
    s[PHI] += fast_atan2(zx, zy)
    s[R] = r
    s[YAW] += w
    s[V] += f
    for i in range(4, N):
        s[i] *= decay[i]
    s[GYRO_BIAS] -= node.gyro_bias_step


@njit(nogil=True)
def _speed_change(c: float, acc_bias: float, node: Node) -> tuple[float, float, float]:
    """Return f and its derivatives by c and by b_a. They are 0 without an accelerometer."""
    if not math.isfinite(node.dv_var):
        return 0.0, 0.0, 0.0
    cc, sc = math.cos(c), math.sin(c)
    f = node.dv_forward * cc + node.dv_left * sc - acc_bias * node.dt_s
    return f, -node.dv_forward * sc + node.dv_left * cc, -node.dt_s


@njit(nogil=True)
def _swing(beta: float, node: Node) -> tuple[float, float]:
    """Return R(beta) g."""
    if node.swing_forward == 0.0 and node.swing_left == 0.0:
        return 0.0, 0.0
    cb, sb = math.cos(beta), math.sin(beta)
    return node.swing_forward * cb - node.swing_left * sb, node.swing_forward * sb + node.swing_left * cb


@njit(nogil=True)
def _fill_motion(
    F: Floats, i: int, by_alpha: float, by_d: float, by_beta: float, dt: float, f_m: float, f_b: float
) -> None:
    """Fill row i of F beyond r and phi, from its derivatives by alpha, d and the direction beta of g."""
    F[i, YAW] = by_alpha + by_beta
    F[i, V] = by_d * dt
    F[i, MOUNT] = by_alpha + by_d * f_m * dt / 2
    F[i, SLIP] = F[i, MOUNT]
    F[i, GYRO_BIAS] = (by_d * (-f_m * dt / 2) - by_alpha) * dt / 2
    F[i, ACC_BIAS] = by_d * f_b * dt / 2


@njit(nogil=True)
def fast_atan2(x: float, y: float) -> float:
    """Return atan2(y, x); for small angles by its series, whose remainder is below the rounding there."""
    if not abs(y) < 0.03 * x:
        return math.atan2(y, x)
    t = y / x
    u = t * t
    return t * (1.0 - u * (1.0 / 3.0 - u * (0.2 - u * (1.0 / 7.0 - u / 9.0))))


@njit(nogil=True)
def _row_of(F: Floats, i: int) -> tuple[float, float, float, float, float, float, float]:
    """Return the entries of a row of F that can differ from zero. That of mount is also that of slip."""
    return F[i, R], F[i, PHI], F[i, YAW], F[i, V], F[i, MOUNT], F[i, GYRO_BIAS], F[i, ACC_BIAS]


@njit(nogil=True)
def _column_of(P: Floats, j: int) -> tuple[float, float, float, float, float, float, float]:
    return P[R, j], P[PHI, j], P[YAW, j], P[V, j], P[MOUNT, j] + P[SLIP, j], P[GYRO_BIAS, j], P[ACC_BIAS, j]


@njit(nogil=True)
def _dot(f: Any, p: Any) -> float:
    return float(f[0] * p[0] + f[1] * p[1] + f[2] * p[2] + f[3] * p[3] + f[4] * p[4] + f[5] * p[5] + f[6] * p[6])


@njit(nogil=True, inline="never")
def predict_covariance(P: Floats, F: Floats, decay: Floats, A: Floats) -> None:
    """Predict the covariance: P = J P J^T, J = [F; diag(decay)], skipping zeros and ones of F. A (4, N) is scratch."""
    f, g = _row_of(F, R), _row_of(F, PHI)
    yaw_g, v_m, v_g, v_a = F[YAW, GYRO_BIAS], F[V, MOUNT], F[V, GYRO_BIAS], F[V, ACC_BIAS]
    for j in range(N):
        p = _column_of(P, j)
        A[R, j], A[PHI, j] = _dot(f, p), _dot(g, p)
        A[YAW, j], A[V, j] = p[2] + yaw_g * p[5], p[3] + v_m * p[4] + v_g * p[5] + v_a * p[6]
    for i in range(4, N):
        for j in range(i, N):
            P[i, j] = P[j, i] = P[i, j] * (decay[i] * decay[j])
    for i in range(4):
        for j in range(4, N):
            P[i, j] = P[j, i] = A[i, j] * decay[j]
        p = _column_of(A.T, i)
        P[i, R], P[i, PHI] = _dot(f, p), _dot(g, p)
        P[i, YAW], P[i, V] = p[2] + yaw_g * p[5], p[3] + v_m * p[4] + v_g * p[5] + v_a * p[6]
    for i in range(4):
        for j in range(i):
            P[i, j] = P[j, i]


@njit(nogil=True)
def fill_noise(decay: Floats, growth: Floats, node: Node, row: Row, t: Tuning) -> None:
    """Fill the decay of every state over the node and the variance it gains.

    `add_process_noise` adds that of r and phi, `fill_class_noise` fills what differs between heading classes.
    """
    dt = node.dt_s
    decay[:] = 1.0
    growth[:] = 0.0
    decay[SLIP] = math.exp(-dt / row.settings.slip_tau)
    decay[ACC_BIAS] = decay[LEFT_BIAS] = math.exp(-dt / t.acc_bias_tau)
    growth[YAW] = node.dyaw_var
    rough = 0.0
    if math.isfinite(node.dv_var):
        unsteady = node.dv_var - node.motion_var
        growth[V] = unsteady + t.q_speed * dt
        rough = max(unsteady, min(node.dv_var, t.bending_roughness * dt)) / dt if dt > 0.0 else 0.0
    else:
        growth[V] = t.q_speed_no_acc * dt
    growth[SLIP] = slip_std_of(row) ** 2 * (1.0 - decay[SLIP] ** 2)
    lost, rough_var = 1.0 - decay[ACC_BIAS] ** 2, t.acc_bias_roughness * rough
    tilted = tilting_growth(node, rough)
    growth[ACC_BIAS] = (t.acc_bias_std**2 + rough_var) * lost + tilted
    growth[LEFT_BIAS] = (t.left_bias_std**2 + rough_var) * lost + tilted
    growth[RANGE_BIAS] = row.settings.range_bias_std**2 * -math.expm1(-2.0 * dt / t.range_bias_tau)
    if node.carried == 1:
        _fill_carried_noise(decay, growth, dt, row, t)


@njit(nogil=True)
def _fill_carried_noise(decay: Floats, growth: Floats, dt: float, row: Row, t: Tuning) -> None:
    """Fill what differs for a carried tag: its course is yaw + mount + slip, where slip is the sway of the hand.

    The mounting angle may be anything, and steps measure the speed, a random walk. Accelerations are not used, so the
    scale and the offset of the steps stand in the state where the accelerometer's biases are otherwise.
    """
    growth[V] = t.q_walk_speed * dt
    growth[MOUNT] = t.q_grip * dt
    decay[SLIP] = math.exp(-dt / t.sway_tau)
    std = row.settings.slip_std if row.settings.slip_given == 1 else t.sway_std
    growth[SLIP] = std**2 * (1.0 - decay[SLIP] ** 2)
    decay[GAIT_OFFSET] = decay[STEP_SCALE] = 1.0
    growth[GAIT_OFFSET], growth[STEP_SCALE] = 0.0, t.q_step_scale * dt


@njit(nogil=True)
def fill_class_noise(decay: Floats, growth: Floats, node: Node, row: Row, heading_class: int, t: Tuning) -> None:
    """Fill what differs between heading classes: the drifts of the gyroscope and of the reference."""
    beside = node.heading_kind == MEASURED_HEADING or node.heading_kind == NO_HEADING
    growth[GYRO_BIAS] = (t.q_gyro if beside else t.q_gyro_own) * node.dt_s
    if row.heading.model == MAGNETOMETER_MODEL and node.heading_kind != ABSOLUTE_HEADING:
        decay[REFERENCE], growth[REFERENCE] = 1.0, 0.0
        return
    heading_var = node.heading_var if math.isfinite(node.heading_var) else 1.0
    _, std, tau = class_reference_error(row, heading_class, heading_var, t)
    before = after = std**2
    if row.heading.model == MAGNETOMETER_MODEL and row.heading.slow_var > 0.0:
        _, slow, _ = reference_error(row, heading_var)
        before += row.heading.slow_var - slow * slow
    decay[REFERENCE], growth[REFERENCE] = follow_reference(math.exp(-node.dt_s / tau), before, after)


@njit(nogil=True, borrows=True)
def add_process_noise(
    s: Floats, P: Floats, F: Floats, growth: Floats, node: Node, row: Row, t: Tuning, nlos: int
) -> None:
    """Add the process noise of one node to P. F is that of `predict_state`.

    The variance of the range bias grows to that of an unknown one at most, however long a tag is tracked.
    """
    dt, bias_var = node.dt_s, row.settings.range_bias_std**2
    known = max(0.0, 1.0 - P[RANGE_BIAS, RANGE_BIAS] / bias_var) if bias_var > 0.0 else 0.0
    q_position = t.q_position if node.carried == 0 else t.walk_position_q
    moved_var = q_position * dt + node.wander_var
    P[R, R] += moved_var
    P[PHI, PHI] += moved_var / max(s[R], 0.1) ** 2
    for i in range(2, N):
        P[i, i] += growth[i] if i != RANGE_BIAS else growth[i] * known
    if not math.isfinite(node.dv_var) and node.carried == 0:
        P[V, V] += t.q_speed_no_acc_moving * min(abs(s[V]), 1.0) ** 2 * dt
    if nlos == 1:
        P[RANGE_BIAS, RANGE_BIAS] += t.q_nlos * dt
    # Speed noise acts during the step, so half of it has already moved the tag at the end.
    if growth[V] > 0.0 and dt > 0.05:
        _correlate_speed_noise(P, F[0, V], F[1, V], growth[V])


@njit(nogil=True)
def _correlate_speed_noise(P: Floats, r_v: float, phi_v: float, q: float) -> None:
    """Correlate position and speed. r_v, phi_v: dr/dv and dphi/dv of the step; q: variance that the speed gained."""
    P[R, V] += q / 2 * r_v
    P[V, R] = P[R, V]
    P[PHI, V] += q / 2 * phi_v
    P[V, PHI] = P[PHI, V]
    P[R, R] += q / 3 * r_v * r_v
    P[R, PHI] += q / 3 * r_v * phi_v
    P[PHI, R] = P[R, PHI]
    P[PHI, PHI] += q / 3 * phi_v * phi_v
