"""Scalar updates of one hypothesis: range, bearing, heading, standstill, and the bounds on the speed."""

import math
from typing import Any

from dropanchor_service.estimation.fleet.belief.layout import CRAB, GYRO, MOUNT, OFFSET, PHI, REF, YAW, N, R, V
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning

TWO_PI = 2.0 * math.pi


@njit(nogil=True)
def wrap(angle: float) -> float:
    """To [-pi, pi)."""
    return float(angle - TWO_PI * math.floor(angle / TWO_PI + 0.5))


@njit(nogil=True)
def gaussian(e: float, S: float) -> float:
    """N(e; 0, S)."""
    return math.exp(-0.5 * e * e / S) / math.sqrt(TWO_PI * S)


@njit(nogil=True, inline="never")
def correct(s: Any, P: Any, PH: Any, S: float, e: float, beta: float) -> None:
    """s += beta K e, P -= K K^T (beta S - beta (1-beta) e^2) with K = P H / S: PDA of one scalar (Bar-Shalom)."""
    shrink = (beta * S - beta * (1.0 - beta) * e * e) / (S * S)
    for i in range(N):
        s[i] += PH[i] * (beta * e / S)
        a = PH[i] * shrink
        for j in range(N):
            P[i, j] -= a * PH[j]


@njit(nogil=True)
def predict_range(s: Any, offset_x: float, offset_y: float, dz: float, lag: float, H: Any) -> float:
    """Slant range to an anchor at (offset_x, offset_y) from the primary one and dz below the tag, `lag` s ago.

    p = r u(phi) - v lag u(course) - offset, z = sqrt(|p|^2 + dz^2) + range offset; H receives d/ds.
    The range offset belongs to the primary anchor only.
    """
    H[:] = 0.0
    own = offset_x == 0.0 and offset_y == 0.0
    bias = s[OFFSET] if own else 0.0
    H[OFFSET] = 1.0 if own else 0.0
    if own and lag == 0.0:
        slant = max(math.sqrt(s[R] ** 2 + dz * dz), 1e-6)
        H[R] = s[R] / slant
        return float(slant + bias)
    c, sn = math.cos(s[PHI]), math.sin(s[PHI])
    course = s[YAW] + s[MOUNT] + s[CRAB]
    cc, cs = math.cos(course), math.sin(course)
    dx = s[R] * c - s[V] * lag * cc - offset_x
    dy = s[R] * sn - s[V] * lag * cs - offset_y
    slant = max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-6)
    H[R] = (dx * c + dy * sn) / slant
    H[PHI] = s[R] * (dy * c - dx * sn) / slant
    H[V] = -lag * (dx * cc + dy * cs) / slant
    H[YAW] = H[MOUNT] = H[CRAB] = -lag * s[V] * (dy * cc - dx * cs) / slant
    return float(slant + bias)


@njit(nogil=True)
def project(P: Any, H: Any, PH: Any) -> float:
    """PH = P H; returns H^T P H."""
    total = 0.0
    for i in range(N):
        PH[i] = 0.0
    for k in range(N):
        h = H[k]
        if h != 0.0:
            for i in range(N):
                PH[i] += P[i, k] * h
    for k in range(N):
        total += H[k] * PH[k]
    return float(total)


@njit(nogil=True)
def update_range(one: Any, scratch: Any, e: float, variance: float, t: Tuning) -> None:
    """One range, whose H is in scratch, with a one-sided outlier mixture, on a HYPOTHESIS.

    scratch.out = (log likelihood, S, probability of an outlier).
    """
    S = project(one.cov, scratch.H, scratch.PH) + variance
    wide = S + t.outlier_std**2
    inside = (1.0 - t.outlier) * gaussian(e, S)
    outside = t.outlier * (gaussian(e - t.outlier_mean, wide) + t.outlier_floor)
    beta = inside / (inside + outside)
    correct(one.mean, one.cov, scratch.PH, S, e, beta)
    scratch.out[0] = math.log(inside + outside)
    scratch.out[1] = S
    scratch.out[2] = 1.0 - beta


@njit(nogil=True)
def update_bearing(s: Any, P: Any, H: Any, PH: Any, ox: float, oy: float, z: float, variance: float, out: Any) -> float:
    """Azimuth of the tag seen from an anchor at (ox, oy) from the primary one; returns the log likelihood.

    out = (innovation, S, probability of an outlier).
    """
    H[:] = 0.0
    c, sn = math.cos(s[PHI]), math.sin(s[PHI])
    dx, dy = s[R] * c - ox, s[R] * sn - oy
    d2 = max(dx * dx + dy * dy, 1e-6)
    H[R] = (dx * sn - dy * c) / d2
    H[PHI] = s[R] * (dx * c + dy * sn) / d2
    e = wrap(z - math.atan2(dy, dx))
    S = project(P, H, PH) + variance
    inside = 0.95 * gaussian(e, S)
    beta = inside / (inside + 0.05 / TWO_PI)
    correct(s, P, PH, S, e, beta)
    out[0] = e
    out[1] = S
    out[2] = 1.0 - beta
    return math.log(inside + 0.05 / TWO_PI)


@njit(nogil=True)
def update_heading(one: Any, scratch: Any, z: float, variance: float) -> None:
    """z = yaw + error of the reference, on a HYPOTHESIS."""
    s, P, PH = one.mean, one.cov, scratch.PH
    for i in range(N):
        PH[i] = P[YAW, i] + P[REF, i]
    e = wrap(z - s[YAW] - s[REF])
    S = PH[YAW] + PH[REF] + variance
    correct(s, P, PH, S, e, 1.0)


@njit(nogil=True)
def update_component(s: Any, P: Any, PH: Any, index: int, z: float, variance: float) -> None:
    """z measures one component of the state."""
    for i in range(N):
        PH[i] = P[i, index]
    S = P[index, index] + variance
    correct(s, P, PH, S, z - s[index], 1.0)


@njit(nogil=True)
def rest_variance(prior: float, node: Any) -> float:
    """Of a measurement that leaves gyro_var of a larger prior."""
    return float(prior * node.gyro_var / (prior - node.gyro_var))


@njit(nogil=True)
def update_rest(s: Any, P: Any, PH: Any, node: Any, t: Tuning) -> float:
    """Standstill: the speed is zero, and what the gyro says is its bias; returns the log likelihood of the latter.

    An IMU's front-end has taken its bias out already: of what is left nothing is learned but that variance.
    """
    if node.rest == 1:
        update_component(s, P, PH, V, 0.0, t.rest_std**2)
    if node.gyro_var > 0.0:
        if P[GYRO, GYRO] > 1.001 * node.gyro_var:
            update_component(s, P, PH, GYRO, 0.0, rest_variance(P[GYRO, GYRO], node))
        return 0.0
    if node.dt_s <= 0.0:
        return 0.0
    rate = node.dyaw / node.dt_s
    variance = node.dyaw_var / node.dt_s**2 + t.rest_rate_std**2
    S = P[GYRO, GYRO] + variance
    e = rate - s[GYRO]
    update_component(s, P, PH, GYRO, rate, variance)
    return float(-0.5 * e * e / S - 0.5 * math.log(S))


@njit(nogil=True)
def bound_speed(s: Any, P: Any, PH: Any, low: float, high: float) -> float:
    """Truncate the speed to [low, high] where its mean is outside; returns the log of the probability it kept.

    Moments of a one-sided truncated Gaussian, carried to the other states by their covariance with the speed.
    """
    if low <= s[V] <= high:
        return 0.0
    sd = math.sqrt(max(P[V, V], 1e-12))
    a, sign = ((s[V] - low) / sd, 1.0) if s[V] < low else ((high - s[V]) / sd, -1.0)
    if a < -8.0:  # asymptotic Mills ratio
        ratio = -a + 1.0 / -a
        log_mass = -0.5 * a * a - math.log(-a) - 0.9189385332
    else:
        mass = 0.5 * math.erfc(-a / math.sqrt(2.0))
        ratio = math.exp(-0.5 * a * a) / math.sqrt(TWO_PI) / mass
        log_mass = math.log(mass)
    kept = max(1.0 - ratio * (ratio + a), 1e-3)
    gain = sign * ratio * sd / P[V, V]
    for i in range(N):
        PH[i] = P[i, V]
    shrink = (1.0 - kept) / P[V, V]
    for i in range(N):
        s[i] += PH[i] * gain
        for j in range(N):
            P[i, j] -= PH[i] * PH[j] * shrink
    return float(log_mass)
