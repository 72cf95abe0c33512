"""A range: what is measured of a state, its noise, its outliers, and what it weighs.

Its variance is `range_variance`, with the noise that the row has learned (`belief/range_noise`). `update_range` is the
likelihood; the numbers of its outliers are `outlier_*` in `tuning`.

Of a height z above the anchor with the variance P, independent of the horizontal distance r,

    E (r^2 + z^2) = r^2 + dz^2 + P        var sqrt(r^2 + z^2) = (dz^2 P + P^2 / 2) / distance^2

A tag is no higher than its range: P counts as that of a uniform height within it at most. The error of a height lasts.
What exceeds the bias that each range may have anyway is therefore counted once in `range_bias_tau`.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.layout import (
    MOUNT,
    PHI,
    RANGE_BIAS,
    SLIP,
    YAW,
    Anchor,
    Anchors,
    Belief,
    Floats,
    Hypotheses,
    Hypothesis,
    R,
    Row,
    Scratch,
    V,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of
from dropanchor_service.estimation.fleet.belief.range_noise import learn_lasting, learn_white, reported_var
from dropanchor_service.estimation.fleet.belief.start import height_variance_at, offset_of, start_distance
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.height import TOLD
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.measurement.scalar import gaussian, project, record_innovation, update_pda
from dropanchor_service.estimation.fleet.measurement.speed import bound_speed
from dropanchor_service.estimation.fleet.tuning import Tuning

ONE_SIDED: Final = 1.5  # standard deviations: an innovation beyond counts for a run of ranges too long or too short
MISFIT_GAIN: Final = 0.1  # weight of the newest range in the mean outlier probability
NEAREST: Final = 1e-3  # m
COVERED_STD: Final = 0.15  # m, of an error of a range that lasts: the filter allows for it
SHORTEST_S: Final = 0.02  # s between two ranges


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
def range_variance(row: Row, node: Node, anchor: Anchor, t: Tuning) -> float:
    """Return the variance of a measured range, m^2: its noise, the tag's height, and a secondary anchor's bias.

    measured = scale * distance + bias, so an error dh of the height changes it by scale * dz / distance * dh.
    """
    settings = row.settings
    dz = settings.height - anchor.z
    distance = max((node.z - settings.range_bias) / settings.range_scale, 0.1)
    variance = max(reported_var(row, node), row.noise.white_var) * row.noise.factor
    variance += (settings.range_scale * dz * settings.height_std / distance) ** 2
    if settings.height_source != TOLD:
        variance += height_variance(row, dz, distance, t)
    if node.anchor != row.anchor:
        variance += settings.range_bias_std**2
    return float(variance)


@njit(nogil=True)
def likelihood_power(node: Node, t: Tuning) -> float:
    """Return the power of a range's likelihood. A body blocks the ranges of a carried tag for seconds."""
    return float(t.walk_likelihood_power if node.carried == 1 else t.likelihood_power)


@njit(nogil=True)
def update_range(one: Hypothesis, scratch: Scratch, e: float, variance: float, t: Tuning) -> None:
    """Update one hypothesis with the innovation e of a range, m, whose H is in scratch.

    p(e) = (1 - q) N(e; 0, S) + q (N(e - mean; 0, S + std^2) + floor): an outlier is too long, by `outlier_mean` or so.
    scratch.out receives (log likelihood, S, probability of an outlier).
    """
    S = project(one.cov, scratch.H, scratch.PH) + variance
    q, wide = t.outlier_probability, S + t.outlier_std**2
    inside = (1.0 - q) * gaussian(e, S)
    outside = q * (gaussian(e - t.outlier_mean, wide) + t.outlier_floor)
    beta = inside / (inside + outside)
    update_pda(one.mean, one.cov, scratch.PH, S, e, beta)
    scratch.out[0] = math.log(inside + outside)
    scratch.out[1] = S
    scratch.out[2] = 1.0 - beta


@njit(nogil=True)
def update_with_range(
    work: Hypotheses, count: int, row: Row, node: Node, anchors: Anchors, t: Tuning, scratch: Scratch, belief: Belief
) -> None:
    """Update every hypothesis with the node's range. The belief gets the innovation of the heaviest one."""
    H, out, settings = scratch.H, scratch.out, row.settings
    anchor, primary = anchors[node.anchor], anchors[row.anchor]
    ox, oy = anchor.x - primary.x, anchor.y - primary.y
    dz = offset_of(settings, settings.height - anchor.z, start_distance(row, node.z))
    learn_white(row, node, t)
    variance, power = range_variance(row, node, anchor, t), likelihood_power(node, t)
    best = best_of(work, count)
    heaviest = work[best].log_weight
    total = mean_e = square_e = 0.0
    y, S, p_outlier = 0.0, 1.0, 0.0
    for h in range(count):
        s = work[h].mean
        e = node.z - predict_range(s, ox, oy, dz, node.lag_s, settings.range_scale, settings.range_bias, H)
        weight = math.exp(work[h].log_weight - heaviest)
        update_range(work[h], scratch, e, variance, t)
        total += weight
        mean_e += weight * e
        square_e += weight * (e * e + out[1])
        work[h].log_weight += power * out[0]
        if s[R] < 0.0:
            s[R] = NEAREST
        work[h].log_weight += bound_speed(work[h], row, node, t, scratch.PH)
        if h == best:
            y, S, p_outlier = e, out[1], out[2]
    mean_e /= total
    learn_lasting(work, count, row, mean_e, square_e / total - mean_e * mean_e, variance, row.since_range_s, t)
    _update_misfit(row, y, S, p_outlier)
    record_innovation(belief, y, S, p_outlier)
    belief.white_std, belief.lasting_std = math.sqrt(row.noise.white_var), math.sqrt(row.noise.lasting_var)


@njit(nogil=True)
def _update_misfit(row: Row, y: float, S: float, p_outlier: float) -> None:
    """Count how many ranges in a row are too long or too short, and average the outlier probability."""
    nlos = row.nlos
    nlos.high_run = nlos.high_run + 1 if y > ONE_SIDED * math.sqrt(S) else 0
    nlos.low_run = nlos.low_run + 1 if y < -ONE_SIDED * math.sqrt(S) else 0
    nlos.misfit += MISFIT_GAIN * (p_outlier - nlos.misfit)


@njit(nogil=True)
def take_height(row: Row, node: Node, belief: Belief) -> None:
    """Take the node's height into the row, unless it is as told, and into what is published."""
    settings = row.settings
    if node.height_std > 0.0:
        settings.height, settings.height_std = node.height, node.height_std
        settings.height_source = node.height_source
    belief.z, belief.z_std = settings.height, settings.height_std


@njit(nogil=True)
def height_variance(row: Row, dz: float, distance: float, t: Tuning) -> float:
    """Return what a height that nobody told adds to the variance of a range, m^2, beside its first-order term."""
    settings = row.settings
    P = height_variance_at(settings, distance)
    second = P * P / (2.0 * distance * distance)
    all_of_it = settings.range_scale**2 * (dz * dz * P / (distance * distance) + second)
    lasting = max(all_of_it - COVERED_STD**2, 0.0) * t.range_bias_tau / max(row.since_range_s, SHORTEST_S)
    return float(settings.range_scale**2 * second + lasting)
