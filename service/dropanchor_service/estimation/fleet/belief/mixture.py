"""Keep the Gaussian sum small and honest: prune, merge, split."""

import math
from typing import Any

from dropanchor_service.estimation.fleet.belief.layout import MOUNT, PHI, WORK, YAW, N, R, V
from dropanchor_service.estimation.fleet.belief.update import wrap
from dropanchor_service.estimation.fleet.compiled import njit


@njit(nogil=True)
def copy_hypothesis(work: Any, source: int, target: int) -> None:
    """target becomes a copy of source."""
    if source != target:
        work[target] = work[source]


@njit(nogil=True)
def best_of(work: Any, count: int) -> int:
    """Index of the heaviest hypothesis; the first one of equals."""
    best = 0
    for h in range(1, count):
        if work[h].log_weight > work[best].log_weight:
            best = h
    return best


@njit(nogil=True)
def normalise(work: Any, count: int) -> None:
    """Log weights to a sum of one."""
    if count == 1:
        work[0].log_weight = 0.0
        return
    top = work[best_of(work, count)].log_weight
    total = 0.0
    for h in range(count):
        total += math.exp(work[h].log_weight - top)
    shift = top + math.log(total)
    for h in range(count):
        work[h].log_weight -= shift


@njit(nogil=True)
def prune(work: Any, count: int, depth: float) -> int:
    """Drop what is lighter than the best by `depth`; returns the new count."""
    floor = work[best_of(work, count)].log_weight - depth
    kept = 0
    for h in range(count):
        if work[h].log_weight >= floor:
            copy_hypothesis(work, h, kept)
            kept += 1
    return kept


@njit(nogil=True)
def put_in_order(work: Any, count: int) -> None:
    """Fill `order`: heaviest first, the first one of equals first."""
    for h in range(count):
        k = h
        while k > 0 and work[work[k - 1].order].log_weight < work[h].log_weight:
            work[k].order = work[k - 1].order
            k -= 1
        work[k].order = h


@njit(nogil=True)
def limit(work: Any, count: int, most: int) -> int:
    """Keep the `most` heaviest."""
    if count <= most:
        return count
    put_in_order(work, count)
    floor = work[work[most - 1].order].log_weight
    kept = 0
    for h in range(count):
        if work[h].log_weight >= floor and kept < most:
            copy_hypothesis(work, h, kept)
            kept += 1
    return kept


@njit(nogil=True)
def angle_variance(P: Any) -> float:
    """Variance of the angle between the course (without crab) and the bearing: what makes the step nonlinear."""
    return float(P[YAW, YAW] + P[MOUNT, MOUNT] + P[PHI, PHI] + 2.0 * (P[YAW, MOUNT] - P[YAW, PHI] - P[MOUNT, PHI]))


@njit(nogil=True)
def _close(work: Any, a: int, b: int, distance: float) -> bool:
    """Every one of r, v, phi and the angle within `distance` standard deviations of the heavier one."""
    if work[a].kind != work[b].kind or work[a].blocked != work[b].blocked:
        return False
    P = work[a].cov
    d2 = distance * distance
    dr = work[b].mean[R] - work[a].mean[R]
    dv = work[b].mean[V] - work[a].mean[V]
    dphi = wrap(work[b].mean[PHI] - work[a].mean[PHI])
    if dr * dr > d2 * P[R, R] + 1e-4 or dv * dv > d2 * P[V, V] + 1e-4 or dphi * dphi > d2 * P[PHI, PHI] + 1e-6:
        return False
    angle = wrap(work[b].mean[YAW] - work[a].mean[YAW]) + work[b].mean[MOUNT] - work[a].mean[MOUNT] - dphi
    return bool(angle * angle <= d2 * angle_variance(P) + 1e-6)


@njit(nogil=True)
def _absorb(work: Any, a: int, b: int) -> None:
    """Moment matching of b into a."""
    wa, wb = math.exp(work[a].log_weight), math.exp(work[b].log_weight)
    share = wb / (wa + wb)
    d = work[a].shift
    for i in range(N):
        d[i] = work[b].mean[i] - work[a].mean[i]
    d[PHI] = wrap(d[PHI])
    d[YAW] = wrap(d[YAW])
    for i in range(N):
        work[a].mean[i] += share * d[i]
        for j in range(N):
            mixed = (1.0 - share) * work[a].cov[i, j] + share * work[b].cov[i, j]
            work[a].cov[i, j] = mixed + share * (1.0 - share) * d[i] * d[j]
    work[a].log_weight = math.log(wa + wb)


@njit(nogil=True)
def merge(work: Any, count: int, distance: float, light: float) -> int:
    """Merge close pairs into the heavier one, heaviest first; returns the new count. Weights must be normalised.

    The lighter one may be the further away: what its place is worth shrinks with its weight, as in Salmond (1990).
    """
    put_in_order(work, count)
    for h in range(count):
        work[h].gone = False
    for ia in range(count):
        a = work[ia].order
        if not work[a].gone:
            _absorb_close(work, count, ia, distance, light)
    kept = 0
    for h in range(count):
        if not work[h].gone:
            copy_hypothesis(work, h, kept)
            kept += 1
    return kept


@njit(nogil=True)
def _absorb_close(work: Any, count: int, ia: int, distance: float, light: float) -> None:
    """Merge what is close to the ia-th heaviest into it."""
    a = work[ia].order
    for ib in range(ia + 1, count):
        b = work[ib].order
        if not work[b].gone:
            lacks = max(work[a].log_weight - work[b].log_weight, 0.0)
            if _close(work, a, b, distance * math.sqrt(1.0 + light * lacks)):
                _absorb(work, a, b)
                work[b].gone = True


@njit(nogil=True)
def split(work: Any, count: int, angle: float, depth: float) -> int:
    """Split what is wider than `angle` into three along that angle's column; returns the new count.

    Weights .2252/.5496/.2252, shifts +-1.0576 sigma, variance along the column times 0.451: first two moments kept.
    """
    floor = work[best_of(work, count)].log_weight - depth
    for h in range(count):
        variance = angle_variance(work[h].cov)
        if variance > angle * angle and work[h].log_weight > floor and count + 2 <= WORK:
            _split_one(work, h, count, variance)
            count += 2
    return count


@njit(nogil=True)
def _split_one(work: Any, h: int, count: int, variance: float) -> None:
    P = work[h].cov
    column = work[h].shift
    for i in range(N):
        column[i] = P[i, YAW] + P[i, MOUNT] - P[i, PHI]
    for i in range(N):
        for j in range(N):
            P[i, j] -= 0.549 * column[i] * column[j] / variance
    copy_hypothesis(work, h, count)
    copy_hypothesis(work, h, count + 1)
    step = 1.0576 / math.sqrt(variance)
    for i in range(N):
        work[count].mean[i] += step * column[i]
        work[count + 1].mean[i] -= step * column[i]
    work[h].log_weight += math.log(0.5496)
    work[count].log_weight += math.log(0.2252)
    work[count + 1].log_weight += math.log(0.2252)


@njit(nogil=True)
def finite(work: Any, count: int) -> bool:
    """Every hypothesis is a number with a positive variance in every direction that can be checked cheaply."""
    for h in range(count):
        if not math.isfinite(work[h].log_weight):
            return False
        for i in range(N):
            if not (math.isfinite(work[h].mean[i]) and work[h].cov[i, i] > -1e-9 and work[h].cov[i, i] < 1e12):
                return False
    return count > 0
