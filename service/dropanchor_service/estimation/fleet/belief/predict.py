"""Predict one hypothesis over a node: constant-course step in polar coordinates.

With w = dyaw - b_g dt, m = mount + crab, alpha = yaw + w/2 + m - phi, f = dv_forward cos m + dv_left sin m - b_a dt and
d = v dt + f dt/2, and with the swing g of a lever (forward, left), turned by yaw - phi:

    z = (r + d cos alpha, d sin alpha) + R(yaw - phi) g,  r' = |z|,  phi' = phi + atan2(z_y, z_x),
    yaw' = yaw + w,  v' = v + f,  crab, b_a and the reference error decay with their time constants.
"""

import math
from typing import Any

from dropanchor_service.estimation.fleet.belief.heading_models import error_of_class
from dropanchor_service.estimation.fleet.belief.layout import (
    ACC,
    COMMON,
    CRAB,
    DRIFTING,
    GYRO,
    MOUNT,
    OFFSET,
    PHI,
    REF,
    YAW,
    N,
    R,
    V,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import ABSOLUTE_HEADING, MEASURED_HEADING, NO_HEADING
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True, inline="never")
def move(s: Any, node: Any, decay: Any, F: Any) -> None:
    """Move the state s (N,) over the node; F (4, N) receives d(r, phi, yaw, v)'/ds before any decay.

    F must be zero or from another call: what is always zero in it is not written.
    """
    dt = node.dt_s
    w = node.dyaw - s[GYRO] * dt
    m = s[MOUNT] + s[CRAB]
    cm, sm = math.cos(m), math.sin(m)
    sensed = math.isfinite(node.dv_var)
    forward = node.dv_forward if sensed else 0.0
    left = node.dv_left if sensed else 0.0
    bias = s[ACC] * dt if sensed else 0.0
    f = forward * cm + left * sm - bias
    f_m = -forward * sm + left * cm
    f_b = -dt if sensed else 0.0
    d = s[V] * dt + f * dt / 2
    alpha = s[YAW] + w / 2 + m - s[PHI]
    ca, sa = math.cos(alpha), math.sin(alpha)
    sx, sy = 0.0, 0.0
    if node.swing_forward != 0.0 or node.swing_left != 0.0:
        cb, sb = math.cos(s[YAW] - s[PHI]), math.sin(s[YAW] - s[PHI])
        sx = node.swing_forward * cb - node.swing_left * sb
        sy = node.swing_forward * sb + node.swing_left * cb
    zx, zy = s[R] + d * ca + sx, d * sa + sy
    r = max(math.sqrt(zx * zx + zy * zy), 1e-6)
    r_alpha, r_d = (-zx * d * sa + zy * d * ca) / r, (zx * ca + zy * sa) / r
    p_alpha, p_d = (zx * d * ca + zy * d * sa) / r**2, (zx * sa - zy * ca) / r**2
    r_beta, p_beta = (zy * sx - zx * sy) / r, (zx * sx + zy * sy) / r**2
    F[0, R], F[1, R] = zx / r, -zy / r**2
    F[0, PHI], F[1, PHI] = -r_alpha - r_beta, 1.0 - p_alpha - p_beta
    F[0, YAW], F[1, YAW] = r_alpha + r_beta, p_alpha + p_beta
    F[0, V], F[1, V] = r_d * dt, p_d * dt
    F[0, MOUNT], F[1, MOUNT] = r_alpha + r_d * f_m * dt / 2, p_alpha + p_d * f_m * dt / 2
    F[0, CRAB], F[1, CRAB] = F[0, MOUNT], F[1, MOUNT]
    F[0, GYRO], F[1, GYRO] = -r_alpha * dt / 2, -p_alpha * dt / 2
    F[0, ACC], F[1, ACC] = r_d * f_b * dt / 2, p_d * f_b * dt / 2
    F[2, YAW], F[2, GYRO] = 1.0, -dt
    F[3, V], F[3, MOUNT], F[3, CRAB], F[3, ACC] = 1.0, f_m, f_m, f_b
    s[PHI] += angle_of(zx, zy)
    s[R] = r
    s[YAW] += w
    s[V] += f
    for i in range(4, N):
        s[i] *= decay[i]
    s[GYRO] -= node.gyro_step


@njit(nogil=True)
def angle_of(x: float, y: float) -> float:
    """atan2(y, x); near zero by its series, whose rest is below the rounding there."""
    if not abs(y) < 0.03 * x:
        return math.atan2(y, x)
    t = y / x
    u = t * t
    return t * (1.0 - u * (1.0 / 3.0 - u * (0.2 - u * (1.0 / 7.0 - u / 9.0))))


@njit(nogil=True)
def _of_row(F: Any, i: int) -> tuple[float, float, float, float, float, float, float]:
    """What is not zero of a row of F; of mount and crab, which act alike, the first."""
    return F[i, R], F[i, PHI], F[i, YAW], F[i, V], F[i, MOUNT], F[i, GYRO], F[i, ACC]


@njit(nogil=True)
def _of_column(P: Any, j: int) -> tuple[float, float, float, float, float, float, float]:
    return P[R, j], P[PHI, j], P[YAW, j], P[V, j], P[MOUNT, j] + P[CRAB, j], P[GYRO, j], P[ACC, j]


@njit(nogil=True)
def _dot(f: Any, p: Any) -> float:
    return float(f[0] * p[0] + f[1] * p[1] + f[2] * p[2] + f[3] * p[3] + f[4] * p[4] + f[5] * p[5] + f[6] * p[6])


@njit(nogil=True, inline="never")
def transport(P: Any, F: Any, decay: Any, A: Any) -> None:
    """P = J P J^T with J = [F; diag(decay)] of `move`, without the zeros and ones of F. A (4, N) is scratch."""
    f, g = _of_row(F, R), _of_row(F, PHI)
    yaw_g, v_m, v_a = F[YAW, GYRO], F[V, MOUNT], F[V, ACC]
    for j in range(N):
        p = _of_column(P, j)
        A[R, j], A[PHI, j] = _dot(f, p), _dot(g, p)
        A[YAW, j], A[V, j] = p[2] + yaw_g * p[5], p[3] + v_m * p[4] + v_a * p[6]
    for i in range(4, N):
        for j in range(i, N):
            P[i, j] = P[j, i] = P[i, j] * (decay[i] * decay[j])
    for i in range(4):
        for j in range(4, N):
            P[i, j] = P[j, i] = A[i, j] * decay[j]
        p = _of_column(A.T, i)
        P[i, R], P[i, PHI] = _dot(f, p), _dot(g, p)
        P[i, YAW], P[i, V] = p[2] + yaw_g * p[5], p[3] + v_m * p[4] + v_a * p[6]
    for i in range(4):
        for j in range(i):
            P[i, j] = P[j, i]


@njit(nogil=True)
def fill_decay(decay: Any, growth: Any, node: Any, row: Any, t: Tuning) -> None:
    """Per-state decay over the node and the variance it adds; r's and phi's by `diffuse`, the classes' own below."""
    dt = node.dt_s
    decay[:] = 1.0
    growth[:] = 0.0
    decay[CRAB] = math.exp(-dt / row.crab_tau)
    decay[ACC] = math.exp(-dt / t.acc_tau)
    growth[YAW] = node.dyaw_var
    rough = 0.0
    if math.isfinite(node.dv_var):
        growth[V] = node.dv_var + t.q_speed * dt
        rough = node.dv_var / dt if dt > 0.0 else 0.0
    else:
        growth[V] = t.q_speed_blind * dt
    growth[MOUNT] = t.q_mount * dt if row.mount_std > 0.0 else 0.0
    growth[CRAB] = row.crab_std**2 * (1.0 - decay[CRAB] ** 2)
    growth[ACC] = (t.acc_std**2 + t.acc_rough * rough) * (1.0 - decay[ACC] ** 2)
    growth[OFFSET] = t.q_offset * dt if row.offset_std > 0.0 else 0.0


@njit(nogil=True)
def fill_class(decay: Any, growth: Any, node: Any, row: Any, kind: int, t: Tuning) -> None:
    """The same of what a class of hypotheses has of its own: the drifts of the gyroscope and of the reference."""
    beside = node.heading_kind == MEASURED_HEADING or node.heading_kind == NO_HEADING
    growth[GYRO] = (t.q_gyro_own if not beside else t.q_gyro_drift if kind == DRIFTING else t.q_gyro) * node.dt_s
    if row.model == COMMON and node.heading_kind != ABSOLUTE_HEADING:
        decay[REF], growth[REF] = 1.0, 0.0
        return
    _, std, tau = error_of_class(row, kind, node.heading_var if math.isfinite(node.heading_var) else 1.0, t)
    decay[REF] = math.exp(-node.dt_s / tau)
    growth[REF] = std**2 * (1.0 - decay[REF] ** 2)


@njit(nogil=True)
def diffuse(s: Any, P: Any, F: Any, growth: Any, node: Any, t: Tuning, blocked: int) -> None:
    """Add the process noise of one node, of `move`'s F, to P."""
    dt = node.dt_s
    P[R, R] += t.q_position * dt
    P[PHI, PHI] += t.q_position * dt / max(s[R], 0.1) ** 2
    for i in range(2, N):
        P[i, i] += growth[i]
    if not math.isfinite(node.dv_var):
        P[V, V] += t.q_speed_blind_moving * min(abs(s[V]), 1.0) ** 2 * dt
    if blocked == 1:
        P[OFFSET, OFFSET] += t.q_blocked * dt
    # speed noise acts during the step, so half of it is already travelled at the end
    if growth[V] > 0.0 and dt > 0.05:
        _travel(P, F[0, V], F[1, V], growth[V])


@njit(nogil=True)
def _travel(P: Any, r_v: float, phi_v: float, q: float) -> None:
    """r_v, phi_v: what a speed has moved the tag by in the step; q: variance that the speed has gathered."""
    P[R, V] += q / 2 * r_v
    P[V, R] = P[R, V]
    P[PHI, V] += q / 2 * phi_v
    P[V, PHI] = P[PHI, V]
    P[R, R] += q / 3 * r_v * r_v
    P[R, PHI] += q / 3 * r_v * phi_v
    P[PHI, R] = P[R, PHI]
    P[PHI, PHI] += q / 3 * phi_v * phi_v
