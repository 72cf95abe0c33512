"""Predict one hypothesis over a node: constant-course step in polar coordinates.

With w = dyaw - b_g dt, m = mount + crab, alpha = yaw + w/2 + m - phi, f = dv_forward cos m + dv_left sin m - b_a dt and
d = v dt + f dt/2, and with the swing g of a lever (forward, left), turned by yaw - phi:

    z = (r + d cos alpha, d sin alpha) + R(yaw - phi) g,  r' = |z|,  phi' = phi + atan2(z_y, z_x),
    yaw' = yaw + w,  v' = v + f,  crab, b_a and the reference error decay with their time constants.
"""

import math
from typing import Any

import numpy as np

from .compiled import njit
from .layout import ACC, COMMON, CRAB, GYRO, MOUNT, OFFSET, PHI, REF, YAW, N, R, V
from .node import ABSOLUTE_HEADING, RELATIVE_HEADING
from .tuning import Tuning


@njit(nogil=True, inline="never")
def move(s: Any, node: Any, decay: Any, F: Any) -> None:
    """Move the state s (N,) over the node; F (4, N) receives d(r, phi, yaw, v)'/ds before any decay."""
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
    cb, sb = math.cos(s[YAW] - s[PHI]), math.sin(s[YAW] - s[PHI])
    sx = node.swing_forward * cb - node.swing_left * sb
    sy = node.swing_forward * sb + node.swing_left * cb
    zx, zy = s[R] + d * ca + sx, d * sa + sy
    r = max(math.hypot(zx, zy), 1e-6)
    r_alpha, r_d = (-zx * d * sa + zy * d * ca) / r, (zx * ca + zy * sa) / r
    p_alpha, p_d = (zx * d * ca + zy * d * sa) / r**2, (zx * sa - zy * ca) / r**2
    r_beta, p_beta = (zy * sx - zx * sy) / r, (zx * sx + zy * sy) / r**2
    F[:] = 0.0
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
    s[PHI] += math.atan2(zy, zx)
    s[R] = r
    s[YAW] += w
    s[V] += f
    for i in range(4, N):
        s[i] *= decay[i]
    s[GYRO] -= node.gyro_step


@njit(nogil=True, inline="never")
def transport(P: Any, F: Any, decay: Any, scratch: Any) -> None:
    """P = A P A^T with A = [F; diag(decay)]: the lower states only decay. scratch is (4, N)."""
    scratch[:] = 0.0
    for i in range(4):
        for k in range(ACC + 1):  # F is zero beyond
            a = F[i, k]
            if a != 0.0:
                for j in range(N):
                    scratch[i, j] += a * P[k, j]
    for i in range(4, N):
        for j in range(4, N):
            P[i, j] *= decay[i] * decay[j]
    for i in range(4):
        for j in range(4, N):
            P[i, j] = P[j, i] = scratch[i, j] * decay[j]
    _upper(P, F, scratch)


@njit(nogil=True)
def _upper(P: Any, F: Any, scratch: Any) -> None:
    for i in range(4):
        for j in range(i, 4):
            total = 0.0
            for k in range(ACC + 1):
                total += scratch[i, k] * F[j, k]
            P[i, j] = P[j, i] = total


@njit(nogil=True)
def fill_decay(decay: Any, growth: Any, node: Any, row: Any, t: Tuning, ref_std: float, ref_tau: float) -> None:
    """Per-state decay over the node and the variance it adds; r's and phi's are added by `diffuse`."""
    dt = node.dt_s
    decay[:] = 1.0
    growth[:] = 0.0
    decay[CRAB] = math.exp(-dt / row.crab_tau)
    decay[ACC] = math.exp(-dt / t.acc_tau)
    decay[REF] = math.exp(-dt / ref_tau)
    growth[YAW] = node.dyaw_var
    rough = 0.0
    if math.isfinite(node.dv_var):
        growth[V] = node.dv_var + t.q_speed * dt
        rough = node.dv_var / dt if dt > 0.0 else 0.0
    else:
        growth[V] = t.q_speed_blind * dt
    growth[MOUNT] = t.q_mount * dt if row.mount_std > 0.0 else 0.0
    growth[CRAB] = row.crab_std**2 * (1.0 - decay[CRAB] ** 2)
    own = node.heading_kind == ABSOLUTE_HEADING or node.heading_kind == RELATIVE_HEADING
    growth[GYRO] = (t.q_gyro_own if own else t.q_gyro) * dt
    growth[ACC] = (t.acc_std**2 + t.acc_rough * rough) * (1.0 - decay[ACC] ** 2)
    growth[REF] = ref_std**2 * (1.0 - decay[REF] ** 2)
    if row.model == COMMON and node.heading_kind != ABSOLUTE_HEADING:
        decay[REF], growth[REF] = 1.0, 0.0
    growth[OFFSET] = t.q_offset * dt if row.offset_std > 0.0 else 0.0


@njit(nogil=True)
def diffuse(s: Any, P: Any, growth: Any, node: Any, t: Tuning, blocked: int) -> None:
    """Add the process noise of one node to P."""
    dt = node.dt_s
    P[R, R] += t.q_position * dt
    P[PHI, PHI] += t.q_position * dt / max(s[R], 0.1) ** 2
    for i in range(2, N):
        P[i, i] += growth[i]
    if not math.isfinite(node.dv_var):
        P[V, V] += t.q_speed_blind_moving * min(abs(s[V]), 1.0) ** 2 * dt
    if blocked == 1:
        P[OFFSET, OFFSET] += t.q_blocked * dt
    growth_speed = growth[V]
    # speed noise acts during the step, so half of it is already travelled at the end
    if growth_speed > 0.0 and dt > 0.05:
        _travel(s, P, growth_speed, dt)


@njit(nogil=True)
def _travel(s: Any, P: Any, q: float, dt: float) -> None:
    a = math.cos(s[YAW] + s[MOUNT] + s[CRAB] - s[PHI])
    b = math.sin(s[YAW] + s[MOUNT] + s[CRAB] - s[PHI]) / max(s[R], 0.1)
    P[R, V] += q * dt / 2 * a
    P[V, R] = P[R, V]
    P[PHI, V] += q * dt / 2 * b
    P[V, PHI] = P[PHI, V]
    P[R, R] += q * dt * dt / 3 * a * a
    P[R, PHI] += q * dt * dt / 3 * a * b
    P[PHI, R] = P[R, PHI]
    P[PHI, PHI] += q * dt * dt / 3 * b * b


def make_scratch() -> tuple[Any, ...]:
    """decay (N,), growth (N,), F (4, N), scratch (4, N)."""
    return np.ones(N), np.zeros(N), np.zeros((4, N)), np.zeros((4, N))
