"""Keep the Gaussian sum small and honest: prune, merge, split."""

import math
from typing import Any

import numpy as np
from numba import njit

from .layout import MOUNT, PHI, WORK, YAW, N, R, V, Work
from .update import wrap


@njit(nogil=True)
def copy_hypothesis(work: Work, source: int, target: int) -> None:
    """target becomes a copy of source."""
    if source != target:
        work.mean[target] = work.mean[source]
        work.cov[target] = work.cov[source]
        work.log_weight[target] = work.log_weight[source]
        work.kind[target] = work.kind[source]
        work.blocked[target] = work.blocked[source]
        work.clear[target] = work.clear[source]


@njit(nogil=True)
def best_of(work: Work, count: int) -> int:
    """Index of the heaviest hypothesis; the first one of equals."""
    best = 0
    for h in range(1, count):
        if work.log_weight[h] > work.log_weight[best]:
            best = h
    return best


@njit(nogil=True)
def normalise(work: Work, count: int) -> None:
    """Log weights to a sum of one."""
    top = work.log_weight[best_of(work, count)]
    total = 0.0
    for h in range(count):
        total += math.exp(work.log_weight[h] - top)
    shift = top + math.log(total)
    for h in range(count):
        work.log_weight[h] -= shift


@njit(nogil=True)
def prune(work: Work, count: int, depth: float) -> int:
    """Drop what is lighter than the best by `depth`; returns the new count."""
    floor = work.log_weight[best_of(work, count)] - depth
    kept = 0
    for h in range(count):
        if work.log_weight[h] >= floor:
            copy_hypothesis(work, h, kept)
            kept += 1
    return kept


@njit(nogil=True)
def limit(work: Work, count: int, most: int) -> int:
    """Keep the `most` heaviest."""
    if count <= most:
        return count
    ordered = np.sort(work.log_weight[:count])
    floor = ordered[count - most]
    kept = 0
    for h in range(count):
        if work.log_weight[h] >= floor and kept < most:
            copy_hypothesis(work, h, kept)
            kept += 1
    return kept


@njit(nogil=True)
def angle_variance(P: Any) -> float:
    """Variance of the angle between the course (without crab) and the bearing: what makes the step nonlinear."""
    return float(P[YAW, YAW] + P[MOUNT, MOUNT] + P[PHI, PHI] + 2.0 * (P[YAW, MOUNT] - P[YAW, PHI] - P[MOUNT, PHI]))


@njit(nogil=True)
def _close(work: Work, a: int, b: int, distance: float) -> bool:
    """Every one of r, v, phi and the angle within `distance` standard deviations of the heavier one."""
    if work.kind[a] != work.kind[b] or work.blocked[a] != work.blocked[b]:
        return False
    P = work.cov[a]
    d2 = distance * distance
    dr = work.mean[b, R] - work.mean[a, R]
    dv = work.mean[b, V] - work.mean[a, V]
    dphi = wrap(work.mean[b, PHI] - work.mean[a, PHI])
    if dr * dr > d2 * P[R, R] + 1e-4 or dv * dv > d2 * P[V, V] + 1e-4 or dphi * dphi > d2 * P[PHI, PHI] + 1e-6:
        return False
    angle = wrap(work.mean[b, YAW] - work.mean[a, YAW]) + work.mean[b, MOUNT] - work.mean[a, MOUNT] - dphi
    return bool(angle * angle <= d2 * angle_variance(P) + 1e-6)


@njit(nogil=True)
def _absorb(work: Work, a: int, b: int) -> None:
    """Moment matching of b into a."""
    wa, wb = math.exp(work.log_weight[a]), math.exp(work.log_weight[b])
    share = wb / (wa + wb)
    d = work.mean[b] - work.mean[a]
    d[PHI] = wrap(d[PHI])
    d[YAW] = wrap(d[YAW])
    for i in range(N):
        work.mean[a, i] += share * d[i]
        for j in range(N):
            mixed = (1.0 - share) * work.cov[a, i, j] + share * work.cov[b, i, j]
            work.cov[a, i, j] = mixed + share * (1.0 - share) * d[i] * d[j]
    work.log_weight[a] = math.log(wa + wb)


@njit(nogil=True)
def merge(work: Work, count: int, distance: float) -> int:
    """Merge close pairs into the heavier one, heaviest first; returns the new count. Weights must be normalised."""
    order = np.argsort(-work.log_weight[:count], kind="mergesort")
    gone = np.zeros(count, np.bool_)
    for ia in range(count):
        a = order[ia]
        if gone[a]:
            continue
        for ib in range(ia + 1, count):
            b = order[ib]
            if not gone[b] and _close(work, a, b, distance):
                _absorb(work, a, b)
                gone[b] = True
    kept = 0
    for h in range(count):
        if not gone[h]:
            copy_hypothesis(work, h, kept)
            kept += 1
    return kept


@njit(nogil=True)
def split(work: Work, count: int, angle: float, depth: float) -> int:
    """Split what is wider than `angle` into three along that angle's column; returns the new count.

    Weights .2252/.5496/.2252, shifts +-1.0576 sigma, variance along the column times 0.451: first two moments kept.
    """
    floor = work.log_weight[best_of(work, count)] - depth
    for h in range(count):
        variance = angle_variance(work.cov[h])
        if variance > angle * angle and work.log_weight[h] > floor and count + 2 <= WORK:
            _split_one(work, h, count, variance)
            count += 2
    return count


@njit(nogil=True)
def _split_one(work: Work, h: int, count: int, variance: float) -> None:
    P = work.cov[h]
    column = P[:, YAW] + P[:, MOUNT] - P[:, PHI]
    for i in range(N):
        for j in range(N):
            P[i, j] -= 0.549 * column[i] * column[j] / variance
    copy_hypothesis(work, h, count)
    copy_hypothesis(work, h, count + 1)
    step = 1.0576 / math.sqrt(variance)
    for i in range(N):
        work.mean[count, i] += step * column[i]
        work.mean[count + 1, i] -= step * column[i]
    work.log_weight[h] += math.log(0.5496)
    work.log_weight[count] += math.log(0.2252)
    work.log_weight[count + 1] += math.log(0.2252)
