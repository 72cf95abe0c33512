"""Scalar updates of one hypothesis: range, bearing, heading, standstill, and the bounds on the speed."""

import math

from dropanchor_service.estimation.fleet.angles import TWO_PI, wrap
from dropanchor_service.estimation.fleet.belief.layout import (
    GYRO_BIAS,
    MOUNT,
    PHI,
    RANGE_BIAS,
    REFERENCE,
    SLIP,
    YAW,
    Floats,
    Hypothesis,
    N,
    R,
    Scratch,
    V,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import RESTING, Node
from dropanchor_service.estimation.fleet.tuning import Tuning

BEARING_OUTLIER = 0.05  # probability that a bearing says nothing
ASYMPTOTIC = -8.0  # standard deviations beyond which erfc has no digits left
HALF_LOG_TWO_PI = 0.9189385332


@njit(nogil=True)
def gaussian(e: float, S: float) -> float:
    """Return the density of N(0, S) at e."""
    return math.exp(-0.5 * e * e / S) / math.sqrt(TWO_PI * S)


@njit(nogil=True, inline="never")
def update_pda(s: Floats, P: Floats, PH: Floats, S: float, e: float, beta: float) -> None:
    """Update with one scalar of innovation e that is no outlier with probability beta (PDA, Bar-Shalom).

    s += beta K e,  P -= K K^T (beta S - beta (1 - beta) e^2),  K = P H / S
    """
    shrink = (beta * S - beta * (1.0 - beta) * e * e) / (S * S)
    for i in range(N):
        s[i] += PH[i] * (beta * e / S)
        a = PH[i] * shrink
        for j in range(N):
            P[i, j] -= a * PH[j]


@njit(nogil=True)
def predict_range(
    s: Floats, ox: float, oy: float, dz: float, lag: float, scale: float, secondary_bias: float, H: Floats
) -> float:
    """Return the range, m, that is measured to an anchor, and fill H with its derivative by the state.

        h(s) = scale |(p, dz)| + bias,   p = r u(phi) - v lag u(course) - (ox, oy)

    The anchor is at (ox, oy) from the primary one and dz below the tag; the measurement is `lag` s older than the
    state. The bias is part of the state for the primary anchor, and `secondary_bias` for every other one.
    """
    H[:] = 0.0
    primary = ox == 0.0 and oy == 0.0
    bias = s[RANGE_BIAS] if primary else secondary_bias
    H[RANGE_BIAS] = 1.0 if primary else 0.0
    if primary and lag == 0.0:
        distance = max(math.sqrt(s[R] ** 2 + dz * dz), 1e-6)
        H[R] = scale * s[R] / distance
        return float(scale * distance + bias)
    c, sn = math.cos(s[PHI]), math.sin(s[PHI])
    course = s[YAW] + s[MOUNT] + s[SLIP]
    cc, cs = math.cos(course), math.sin(course)
    dx = s[R] * c - s[V] * lag * cc - ox
    dy = s[R] * sn - s[V] * lag * cs - oy
    distance = max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-6)
    H[R] = scale * (dx * c + dy * sn) / distance
    H[PHI] = scale * s[R] * (dy * c - dx * sn) / distance
    H[V] = scale * -lag * (dx * cc + dy * cs) / distance
    H[YAW] = H[MOUNT] = H[SLIP] = scale * -lag * s[V] * (dy * cc - dx * cs) / distance
    return float(scale * distance + bias)


@njit(nogil=True)
def project(P: Floats, H: Floats, PH: Floats) -> float:
    """Fill PH with P H and return H^T P H."""
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
def update_range(
    one: Hypothesis, scratch: Scratch, e: float, variance: float, p: float, mean: float, std: float, t: Tuning
) -> None:
    """Update one hypothesis with the innovation e of a range, m, whose H is in scratch.

    p(e) = (1 - p) N(e; 0, S) + p (N(e - mean; 0, S + std^2) + floor): an outlier is too long, by `mean` or so.
    scratch.out receives (log likelihood, S, probability of an outlier).
    """
    S = project(one.cov, scratch.H, scratch.PH) + variance
    wide = S + std**2
    inside = (1.0 - p) * gaussian(e, S)
    outside = p * (gaussian(e - mean, wide) + t.outlier_floor)
    beta = inside / (inside + outside)
    update_pda(one.mean, one.cov, scratch.PH, S, e, beta)
    scratch.out[0] = math.log(inside + outside)
    scratch.out[1] = S
    scratch.out[2] = 1.0 - beta


@njit(nogil=True)
def update_bearing(
    s: Floats, P: Floats, H: Floats, PH: Floats, ox: float, oy: float, z: float, variance: float, out: Floats
) -> float:
    """Update with the azimuth z, rad, of the tag seen from an anchor at (ox, oy) from the primary one.

    An outlier may have any azimuth. out receives (innovation, S, probability of an outlier). Return the log likelihood.
    """
    H[:] = 0.0
    c, sn = math.cos(s[PHI]), math.sin(s[PHI])
    dx, dy = s[R] * c - ox, s[R] * sn - oy
    d2 = max(dx * dx + dy * dy, 1e-6)
    H[R] = (dx * sn - dy * c) / d2
    H[PHI] = s[R] * (dx * c + dy * sn) / d2
    e = wrap(z - math.atan2(dy, dx))
    S = project(P, H, PH) + variance
    inside = (1.0 - BEARING_OUTLIER) * gaussian(e, S)
    beta = inside / (inside + BEARING_OUTLIER / TWO_PI)
    update_pda(s, P, PH, S, e, beta)
    out[0] = e
    out[1] = S
    out[2] = 1.0 - beta
    return math.log(inside + BEARING_OUTLIER / TWO_PI)


@njit(nogil=True)
def update_heading(one: Hypothesis, scratch: Scratch, z: float, variance: float) -> None:
    """Update one hypothesis with a heading, rad: z = yaw + error of the reference."""
    s, P, PH = one.mean, one.cov, scratch.PH
    for i in range(N):
        PH[i] = P[YAW, i] + P[REFERENCE, i]
    e = wrap(z - s[YAW] - s[REFERENCE])
    S = PH[YAW] + PH[REFERENCE] + variance
    update_pda(s, P, PH, S, e, 1.0)


@njit(nogil=True)
def update_component(s: Floats, P: Floats, PH: Floats, index: int, z: float, variance: float) -> None:
    """Update with z, a measurement of one component of the state."""
    for i in range(N):
        PH[i] = P[i, index]
    S = P[index, index] + variance
    update_pda(s, P, PH, S, z - s[index], 1.0)


@njit(nogil=True)
def pseudo_measurement_variance(prior: float, node: Node) -> float:
    """Return the variance of a measurement of the gyroscope's bias that turns a larger prior into gyro_bias_var."""
    return float(prior * node.gyro_bias_var / (prior - node.gyro_bias_var))


@njit(nogil=True)
def update_standstill(s: Floats, P: Floats, PH: Floats, node: Node, t: Tuning) -> float:
    """Update with standstill: the speed is zero, and the gyroscope reads its bias. Return the latter's log likelihood.

    An IMU's front-end has already removed the bias; then only the variance of what is left is learned.
    """
    if node.rest == RESTING:
        update_component(s, P, PH, V, 0.0, t.rest_std**2)
    if node.carried == 1:
        return 0.0
    if node.gyro_bias_var > 0.0:
        if P[GYRO_BIAS, GYRO_BIAS] > 1.001 * node.gyro_bias_var:
            update_component(s, P, PH, GYRO_BIAS, 0.0, pseudo_measurement_variance(P[GYRO_BIAS, GYRO_BIAS], node))
        return 0.0
    if node.dt_s <= 0.0:
        return 0.0
    rate = node.dyaw / node.dt_s
    variance = node.dyaw_var / node.dt_s**2 + t.rest_gyro_std**2
    S = P[GYRO_BIAS, GYRO_BIAS] + variance
    e = rate - s[GYRO_BIAS]
    update_component(s, P, PH, GYRO_BIAS, rate, variance)
    return float(-0.5 * e * e / S - 0.5 * math.log(S))


@njit(nogil=True)
def truncate_speed(s: Floats, P: Floats, PH: Floats, low: float, high: float) -> float:
    """Truncate the speed to [low, high] if its mean is outside. Return the log of the probability that was kept.

    The moments are those of a one-sided truncated Gaussian; the other states follow by their covariance with the speed.
    """
    if low <= s[V] <= high:
        return 0.0
    sd = math.sqrt(max(P[V, V], 1e-12))
    a, sign = ((s[V] - low) / sd, 1.0) if s[V] < low else ((high - s[V]) / sd, -1.0)
    if a < ASYMPTOTIC:  # Mills ratio
        ratio = -a + 1.0 / -a
        log_mass = -0.5 * a * a - math.log(-a) - HALF_LOG_TWO_PI
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
