"""Keep the Gaussian mixture small and consistent: normalise, prune and merge."""

import math

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.layout import (
    MAX_HYPOTHESES,
    MOUNT,
    PHI,
    YAW,
    Floats,
    Hypotheses,
    Hypothesis,
    N,
    R,
    Row,
    V,
)
from dropanchor_service.estimation.fleet.belief.start import starts_at_place
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning

MERGED_MOUNTS = 0.2  # rad, by which two mounting angles differ at most that are merged
LIGHT = 6.0  # log weight below the best at which one is not split, and its line of sight not doubted


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
def clear_state(P: Floats, i: int, variance: float) -> None:
    """Make a state one that is known with this variance, independently of the others."""
    for j in range(N):
        P[i, j] = P[j, i] = 0.0
    P[i, i] = variance


@njit(nogil=True)
def gets_child(work: Hypotheses, h: int, count: int, top: float, depth: float) -> bool:
    """Return whether a birth gives hypothesis h a child: there is room, and it is not too light for it.

    top: log weight of the heaviest. depth: below it, at which one is too light.
    """
    return bool(count < MAX_HYPOTHESES and work[h].log_weight >= top - depth)


@njit(nogil=True)
def angle_variance(P: Floats) -> float:
    """Return the variance, rad^2, of course (without slip) minus bearing: the angle that makes a step non-linear."""
    return float(P[YAW, YAW] + P[MOUNT, MOUNT] + P[PHI, PHI] + 2.0 * (P[YAW, MOUNT] - P[YAW, PHI] - P[MOUNT, PHI]))


@njit(nogil=True)
def is_mounted_otherwise(a: Hypothesis, b: Hypothesis) -> bool:
    """Return whether two hypotheses take the body to be mounted in two quite different ways."""
    return bool(abs(wrap(a.mean[MOUNT] - b.mean[MOUNT])) > 2.0 * MERGED_MOUNTS)


@njit(nogil=True)
def max_hypotheses(row: Row, t: Tuning) -> int:
    """Return how many hypotheses the row may have now: most while it may be anywhere around the anchor.

    A carried tag has fewest, and its ellipse is widened instead.
    """
    if row.publication.resolved == 1 and row.walk.carried == 1:
        return t.walk_hypotheses
    if row.publication.resolved == 0 and row.start.coarse == 1:
        return t.coarse_hypotheses
    return MAX_HYPOTHESES // 2 if row.publication.resolved == 1 or starts_at_place(row) else MAX_HYPOTHESES


@njit(nogil=True)
def _are_alike(a: Hypothesis, b: Hypothesis) -> bool:
    """Return whether two hypotheses say the same of heading, line of sight, direction and mounting angle."""
    if a.heading_class != b.heading_class or a.nlos != b.nlos or a.reverse != b.reverse:
        return False
    return bool(abs(wrap(b.mean[MOUNT] - a.mean[MOUNT])) <= MERGED_MOUNTS)


@njit(nogil=True)
def _are_close(a: Hypothesis, b: Hypothesis, distance: float) -> bool:
    """Return whether r, v, phi and that angle are each within `distance` standard deviations of the heavier one, a."""
    P = a.cov
    d2 = distance * distance
    dr = b.mean[R] - a.mean[R]
    dv = b.mean[V] - a.mean[V]
    dphi = wrap(b.mean[PHI] - a.mean[PHI])
    if dr * dr > d2 * P[R, R] + 1e-4 or dv * dv > d2 * P[V, V] + 1e-4 or dphi * dphi > d2 * P[PHI, PHI] + 1e-6:
        return False
    angle = wrap(wrap(b.mean[YAW] - a.mean[YAW]) + b.mean[MOUNT] - a.mean[MOUNT] - dphi)
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


@njit(nogil=True, borrows=True)
def _merge_close(work: Hypotheses, count: int, ia: int, distance: float, light: float) -> None:
    """Merge hypotheses close to the ia-th heaviest into it. What is cheap to compare is compared first."""
    heavier = work[ia].by_weight
    a = work[heavier]
    for ib in range(ia + 1, count):
        lighter = work[ib].by_weight
        b = work[lighter]
        if not b.merged and _are_alike(a, b):
            lacks = max(a.log_weight - b.log_weight, 0.0)
            if _are_close(a, b, distance * math.sqrt(1.0 + light * lacks)):
                _merge_into(work, heavier, lighter)
                b.merged = True


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
