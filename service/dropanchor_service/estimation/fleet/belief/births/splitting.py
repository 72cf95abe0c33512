"""Split a hypothesis into three along the angle between its course and its bearing, where that makes it non-linear."""

import math

from dropanchor_service.estimation.fleet.belief.births.numbers import SPLIT_CURVED, SPLIT_WIDE
from dropanchor_service.estimation.fleet.belief.layout import (
    MOUNT,
    PHI,
    SLIP,
    WORKING_HYPOTHESES,
    YAW,
    Hypotheses,
    Hypothesis,
    N,
    Row,
    V,
)
from dropanchor_service.estimation.fleet.belief.mixture import (
    LIGHT,
    angle_variance,
    best_of,
    copy_hypothesis,
    is_mounted_otherwise,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MOVING, Node
from dropanchor_service.estimation.fleet.tuning import Tuning, is_on

SPLIT_CENTRE, SPLIT_SIDE = 0.5496, 0.2252  # weights of the three parts
SPLIT_SHIFT = 1.0576  # standard deviations
SPLIT_REMOVED = 0.549  # share of the variance
LEAST_WAY = 0.1  # m, driven since the start, before which nothing is split
LEAST_RATE = 0.01  # m/s, error of a range rate below which nothing is split


@njit(nogil=True)
def split(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Split what a motion makes non-linear: a wide angle, or a curved range rate. Return the count of hypotheses."""
    if node.rest != MOVING or row.start.way < LEAST_WAY:
        return count
    curved = is_on(SPLIT_CURVED, t) and may_split_curved(work, count, row)
    floor = work[best_of(work, count)].log_weight - LIGHT
    for h in range(count):
        one = work[h]
        if one.log_weight >= floor and count + 2 <= WORKING_HYPOTHESES:
            wide = is_on(SPLIT_WIDE, t) and is_wide(one, row, t)
            if wide or (curved and is_curved(one, t)):
                add_parts(work, h, count)
                count += 2
    return count


@njit(nogil=True)
def curvature(one: Hypothesis, variance: float) -> float:
    """Return how far from linear the range rate v cos a is over the errors of the speed v and the angle a.

    It is their product, |sin a| sd(v) sd(a), over what a linear update takes the error of the rate for. A tag that
    travels across the line of sight with a slowly learned speed has 0.3 and more. variance: rad^2, of a.
    """
    s, P = one.mean, one.cov
    a = s[YAW] + s[MOUNT] + s[SLIP] - s[PHI]
    c, turned = math.cos(a), s[V] * math.sin(a)
    rate = c * c * P[V, V] + turned * turned * variance - 2.0 * c * turned * (P[V, YAW] + P[V, MOUNT] - P[V, PHI])
    return abs(math.sin(a)) * math.sqrt(max(P[V, V] * variance, 0.0) / (max(rate, 0.0) + LEAST_RATE**2))


@njit(nogil=True)
def are_mounted_alike(work: Hypotheses, count: int) -> bool:
    """Return whether no hypothesis takes the body to be mounted quite differently from the best one."""
    best, others = work[best_of(work, count)], 0
    for h in range(count):
        others += is_mounted_otherwise(work[h], best)
    return bool(others == 0)


@njit(nogil=True)
def may_split_curved(work: Hypotheses, count: int, row: Row) -> bool:
    """Return whether a vehicle's hypotheses are split by their curvature: not while they must cover a wide guess."""
    vehicle = row.publication.resolved == 1 and row.walk.carried == 0 and row.start.coarse == 0
    return bool(vehicle and are_mounted_alike(work, count))


@njit(nogil=True)
def split_angle(row: Row, t: Tuning) -> float:
    """Return the angle, rad, from which on a hypothesis is split, whatever its curvature."""
    if row.walk.carried == 1:
        return t.walk_split_angle
    return t.coarse_split_angle if row.start.coarse == 1 else t.split_angle


@njit(nogil=True)
def is_wide(one: Hypothesis, row: Row, t: Tuning) -> bool:
    """Return whether the angle of a hypothesis is too wide for a linear update."""
    angle = split_angle(row, t)
    return bool(angle_variance(one.cov) > angle * angle)


@njit(nogil=True)
def is_curved(one: Hypothesis, t: Tuning) -> bool:
    """Return whether the range rate of a hypothesis is not linear."""
    return curvature(one, angle_variance(one.cov)) > t.split_curvature


@njit(nogil=True)
def add_parts(work: Hypotheses, h: int, count: int) -> None:
    """Split a hypothesis into three along its angle.

    The weights and shifts, and a variance along the angle of 0.451 of what it was, keep the first two moments.
    """
    P = work[h].cov
    variance = angle_variance(P)
    column = work[h].delta
    for i in range(N):
        column[i] = P[i, YAW] + P[i, MOUNT] - P[i, PHI]
    for i in range(N):
        for j in range(N):
            P[i, j] -= SPLIT_REMOVED * column[i] * column[j] / variance
    copy_hypothesis(work, h, count)
    copy_hypothesis(work, h, count + 1)
    step = SPLIT_SHIFT / math.sqrt(variance)
    for i in range(N):
        work[count].mean[i] += step * column[i]
        work[count + 1].mean[i] -= step * column[i]
    work[h].log_weight += math.log(SPLIT_CENTRE)
    work[count].log_weight += math.log(SPLIT_SIDE)
    work[count + 1].log_weight += math.log(SPLIT_SIDE)
