"""Keep the Gaussian mixture small and consistent: normalise, prune, merge and split."""

import math

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.layout import (
    MAX_HYPOTHESES,
    MOUNT,
    PHI,
    SLIP,
    WORKING_HYPOTHESES,
    YAW,
    Floats,
    Hypotheses,
    Hypothesis,
    N,
    R,
    Row,
    V,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning

SPLIT_CENTRE, SPLIT_SIDE = 0.5496, 0.2252  # weights of the three parts
SPLIT_SHIFT = 1.0576  # standard deviations
SPLIT_REMOVED = 0.549  # share of the variance
MERGED_MOUNTS = 0.2  # rad, by which two mounting angles differ at most that are merged
LEAST_RATE = 0.01  # m/s, error of a range rate below which nothing is split
ALIKE = 2.0  # ratio of two variances that are alike


@njit(nogil=True)
def copy_hypothesis(work: Hypotheses, source: int, target: int) -> None:
    """Copy hypothesis `source` to `target`."""
    if source != target:
        work[target] = work[source]


@njit(nogil=True)
def best_of(work: Hypotheses, count: int) -> int:
    """Return the index of the heaviest hypothesis, the first of equals."""
    best = 0
    for h in range(1, count):
        if work[h].log_weight > work[best].log_weight:
            best = h
    return best


@njit(nogil=True)
def normalise(work: Hypotheses, count: int) -> None:
    """Normalise the weights to a sum of one."""
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
def prune(work: Hypotheses, count: int, depth: float) -> int:
    """Drop hypotheses whose log weight is more than `depth` below the best. Return the count."""
    floor = work[best_of(work, count)].log_weight - depth
    kept = 0
    for h in range(count):
        if work[h].log_weight >= floor:
            copy_hypothesis(work, h, kept)
            kept += 1
    return kept


@njit(nogil=True)
def sort_by_weight(work: Hypotheses, count: int) -> None:
    """Fill `by_weight` with indices, the heaviest first. The sort is stable."""
    for h in range(count):
        k = h
        while k > 0 and work[work[k - 1].by_weight].log_weight < work[h].log_weight:
            work[k].by_weight = work[k - 1].by_weight
            k -= 1
        work[k].by_weight = h


@njit(nogil=True)
def keep_heaviest(work: Hypotheses, count: int, most: int) -> int:
    """Keep the `most` heaviest hypotheses. Return the count."""
    if count <= most:
        return count
    sort_by_weight(work, count)
    floor = work[work[most - 1].by_weight].log_weight
    kept = 0
    for h in range(count):
        if work[h].log_weight >= floor and kept < most:
            copy_hypothesis(work, h, kept)
            kept += 1
    return kept


@njit(nogil=True)
def angle_variance(P: Floats) -> float:
    """Return the variance, rad^2, of course (without slip) minus bearing: the angle that makes a step non-linear."""
    return float(P[YAW, YAW] + P[MOUNT, MOUNT] + P[PHI, PHI] + 2.0 * (P[YAW, MOUNT] - P[YAW, PHI] - P[MOUNT, PHI]))


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
def are_aligned_alike(work: Hypotheses, count: int) -> bool:
    """Return whether all hypotheses, or none, take the body axis to point along the course."""
    aligned = 0
    for h in range(count):
        aligned += work[h].aligned
    return bool(aligned == 0 or aligned == count)


@njit(nogil=True)
def is_mounted_otherwise(a: Hypothesis, b: Hypothesis) -> bool:
    """Return whether two hypotheses take the body to be mounted in two quite different ways."""
    return bool(abs(wrap(a.mean[MOUNT] - b.mean[MOUNT])) > 2.0 * MERGED_MOUNTS)


@njit(nogil=True)
def are_mounted_alike(work: Hypotheses, count: int) -> bool:
    """Return whether no hypothesis takes the body to be mounted quite differently from the best one."""
    best, others = work[best_of(work, count)], 0
    for h in range(count):
        others += is_mounted_otherwise(work[h], best)
    return bool(others == 0)


@njit(nogil=True)
def max_hypotheses(row: Row, t: Tuning) -> int:
    """Return how many hypotheses the row may have now. A carried tag has fewer, whose ellipse is widened instead."""
    if row.publication.resolved == 1:
        return MAX_HYPOTHESES if row.walk.carried == 0 else t.walk_hypotheses
    return t.coarse_hypotheses if row.start.coarse == 1 else MAX_HYPOTHESES


@njit(nogil=True)
def _know_mount_alike(a: Hypothesis, b: Hypothesis) -> bool:
    """Return whether two hypotheses know the mounting angle about as well, if only one took the body as aligned.

    Else the wide one, which keeps other angles possible, would vanish in the narrow one that is heavier by its prior.
    """
    least, most = min(a.cov[MOUNT, MOUNT], b.cov[MOUNT, MOUNT]), max(a.cov[MOUNT, MOUNT], b.cov[MOUNT, MOUNT])
    return bool(a.aligned == b.aligned or most < ALIKE * least)


@njit(nogil=True)
def _are_close(work: Hypotheses, a: int, b: int, distance: float) -> bool:
    """Return whether r, v, phi and that angle are each within `distance` standard deviations of the heavier one, a."""
    if (
        work[a].heading_class != work[b].heading_class
        or work[a].nlos != work[b].nlos
        or work[a].reverse != work[b].reverse
        or not _know_mount_alike(work[a], work[b])
        or abs(wrap(work[a].mean[MOUNT] - work[b].mean[MOUNT])) > MERGED_MOUNTS
    ):
        return False
    P = work[a].cov
    d2 = distance * distance
    dr = work[b].mean[R] - work[a].mean[R]
    dv = work[b].mean[V] - work[a].mean[V]
    dphi = wrap(work[b].mean[PHI] - work[a].mean[PHI])
    if dr * dr > d2 * P[R, R] + 1e-4 or dv * dv > d2 * P[V, V] + 1e-4 or dphi * dphi > d2 * P[PHI, PHI] + 1e-6:
        return False
    angle = wrap(wrap(work[b].mean[YAW] - work[a].mean[YAW]) + work[b].mean[MOUNT] - work[a].mean[MOUNT] - dphi)
    return bool(angle * angle <= d2 * angle_variance(P) + 1e-6)


@njit(nogil=True)
def _merge_into(work: Hypotheses, a: int, b: int) -> None:
    """Merge b into a by moment matching."""
    wa, wb = math.exp(work[a].log_weight), math.exp(work[b].log_weight)
    share = wb / (wa + wb)
    d = work[a].delta
    for i in range(N):
        d[i] = work[b].mean[i] - work[a].mean[i]
    d[PHI] = wrap(d[PHI])
    d[YAW] = wrap(d[YAW])
    d[MOUNT] = wrap(d[MOUNT])
    for i in range(N):
        work[a].mean[i] += share * d[i]
        for j in range(N):
            mixed = (1.0 - share) * work[a].cov[i, j] + share * work[b].cov[i, j]
            work[a].cov[i, j] = mixed + share * (1.0 - share) * d[i] * d[j]
    work[a].log_weight = math.log(wa + wb)


@njit(nogil=True)
def merge(work: Hypotheses, count: int, distance: float, light: float) -> int:
    """Merge close pairs into the heavier one, heaviest first. Return the count. Weights must be normalised.

    A lighter hypothesis may be further away, because merging it changes the moments less (Salmond 1990).
    """
    sort_by_weight(work, count)
    for h in range(count):
        work[h].merged = False
    for ia in range(count):
        a = work[ia].by_weight
        if not work[a].merged:
            _merge_close(work, count, ia, distance, light)
    kept = 0
    for h in range(count):
        if not work[h].merged:
            copy_hypothesis(work, h, kept)
            kept += 1
    return kept


@njit(nogil=True)
def _merge_close(work: Hypotheses, count: int, ia: int, distance: float, light: float) -> None:
    """Merge hypotheses close to the ia-th heaviest into it."""
    a = work[ia].by_weight
    for ib in range(ia + 1, count):
        b = work[ib].by_weight
        if not work[b].merged:
            lacks = max(work[a].log_weight - work[b].log_weight, 0.0)
            if _are_close(work, a, b, distance * math.sqrt(1.0 + light * lacks)):
                _merge_into(work, a, b)
                work[b].merged = True


@njit(nogil=True)
def may_split_curved(work: Hypotheses, count: int, row: Row) -> bool:
    """Return whether a vehicle's hypotheses are split by their curvature: not while they must cover a wide guess."""
    vehicle = row.publication.resolved == 1 and row.walk.carried == 0 and row.start.coarse == 0
    return bool(vehicle and are_aligned_alike(work, count) and are_mounted_alike(work, count))


@njit(nogil=True)
def split(work: Hypotheses, count: int, angle: float, curved: float, depth: float) -> int:
    """Split hypotheses whose angle is wider than `angle`, rad, into three along it. Return the count.

    A narrower angle is split, too, where the curvature exceeds `curved`.

    The weights and shifts below, and a variance along the angle of 0.451 of what it was, keep the first two moments.
    """
    floor = work[best_of(work, count)].log_weight - depth
    for h in range(count):
        variance = angle_variance(work[h].cov)
        wide = variance > angle * angle or curvature(work[h], variance) > curved
        if wide and work[h].log_weight > floor and count + 2 <= WORKING_HYPOTHESES:
            _split_one(work, h, count, variance)
            count += 2
    return count


@njit(nogil=True)
def _split_one(work: Hypotheses, h: int, count: int, variance: float) -> None:
    P = work[h].cov
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


@njit(nogil=True)
def all_finite(work: Hypotheses, count: int) -> bool:
    """Return whether all weights, means and variances are finite and in range, and there is a hypothesis at all."""
    for h in range(count):
        if not math.isfinite(work[h].log_weight):
            return False
        for i in range(N):
            if not (math.isfinite(work[h].mean[i]) and work[h].cov[i, i] > -1e-9 and work[h].cov[i, i] < 1e12):
                return False
    return count > 0
