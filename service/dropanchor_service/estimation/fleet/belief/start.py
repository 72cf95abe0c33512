"""The first hypotheses: around a known start, or a ring of bearings and speeds at the first ranges."""

import math
from typing import Any

import numpy as np

from dropanchor_service.estimation.fleet.belief.heading_models import error_of, reset_models, told_of
from dropanchor_service.estimation.fleet.belief.heading_reference import give_reference_error, turn_about
from dropanchor_service.estimation.fleet.belief.layout import (
    ACC,
    COMMON,
    CRAB,
    DRIFTING,
    EXACT,
    GYRO,
    KEEP,
    MOUNT,
    OFFSET,
    OWN_ERROR,
    PHI,
    REF,
    RING_RANGES,
    STEADY,
    WANDERING,
    YAW,
    N,
    R,
    V,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of, copy_hypothesis
from dropanchor_service.estimation.fleet.belief.update import update_component, wrap
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import (
    ABSOLUTE_HEADING,
    DERIVED_HEADING,
    MEASURED_HEADING,
    NO_HEADING,
    RANGE,
    RELATIVE_HEADING,
)
from dropanchor_service.estimation.fleet.frontend.preintegration import unwatched_turn
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def _common(work: Any, h: int, row: Any, node: Any, yaw: float, yaw_variance: float, t: Tuning) -> None:
    s, P = work[h].mean, work[h].cov
    s[:] = 0.0
    P[:] = 0.0
    s[YAW] = yaw
    s[MOUNT] = row.mount
    s[OFFSET] = row.offset
    P[YAW, YAW] = yaw_variance
    P[MOUNT, MOUNT] = row.mount_std**2
    P[CRAB, CRAB] = row.crab_std**2
    P[GYRO, GYRO] = max(row.gyro_std**2, node.gyro_var)
    P[ACC, ACC] = t.acc_std**2
    P[OFFSET, OFFSET] = row.offset_std**2
    work[h].log_weight = 0.0
    work[h].kind = EXACT
    work[h].blocked = 0


@njit(nogil=True)
def is_referred(kind: int) -> bool:
    """The heading is in the site frame."""
    return kind != NO_HEADING and kind != RELATIVE_HEADING


@njit(nogil=True)
def counts_from(row: Any, node: Any) -> bool:
    """The yaw of the hypotheses counts from the node's heading."""
    return is_referred(node.heading_kind) and (node.heading_kind != ABSOLUTE_HEADING or row.model == COMMON)


@njit(nogil=True)
def choose_model(row: Any, node: Any, t: Tuning) -> None:
    """The heading error's model where the kind of heading gives it; a platform's heading is that of its travel."""
    if node.heading_kind == ABSOLUTE_HEADING:
        row.model = COMMON
        if row.start_known == 1 and math.isfinite(row.start_heading):
            row.north = wrap(node.heading - row.start_heading)
    elif is_referred(node.heading_kind) and math.isfinite(row.heading_std):
        row.reference_std = row.heading_std
    if node.heading_kind == DERIVED_HEADING:
        row.model = STEADY
        row.mount_std = min(row.mount_std, t.platform_mount_std)
        row.crab_tau = t.platform_crab_tau
        if row.slip_known == 0:
            row.crab_std = t.platform_crab_std


@njit(nogil=True)
def _aligned(work: Any, count: int, row: Any, t: Tuning) -> int:
    """Copies of the hypotheses for a body axis along the course, where it mostly is; returns their number."""
    if row.mount_std <= t.aligned_std:
        return 0
    for h in range(count):
        copy_hypothesis(work, h, count + h)
        work[count + h].cov[MOUNT, MOUNT] = t.aligned_std**2
        work[count + h].log_weight += t.aligned_log_prior
    return count


@njit(nogil=True)
def _bearings(row: Any, t: Tuning) -> int:
    return t.coarse_bearings if row.coarse == 1 else t.ring_bearings


@njit(nogil=True)
def start_known(work: Any, row: Any, anchor: Any, node: Any, t: Tuning) -> int:
    """Hypotheses at the given start, one per class, or a ring of headings where none is known; returns the count."""
    x, y = row.start_x - anchor.x, row.start_y - anchor.y
    r = max(math.hypot(x, y), 1e-3)
    given = math.isfinite(row.start_heading)
    known = given or is_referred(node.heading_kind)
    ring = 1 if known else _bearings(row, t)
    cell = 2.0 * math.pi / ring
    choose_model(row, node, t)
    for h in range(ring):
        yaw = row.start_heading if given else node.heading - row.north + cell * h
        variance = row.start_heading_std**2 if given else node.heading_var
        _common(work, h, row, node, yaw, variance if known else (cell / 2.0) ** 2, t)
        s, P = work[h].mean, work[h].cov
        s[R], s[PHI] = r, math.atan2(y, x)
        P[R, R] = row.start_std**2
        P[PHI, PHI] = (row.start_std / r) ** 2
        P[V, V] = row.start_speed_std**2
        if row.coarse == 1 and not known:
            turned = wrap(yaw - row.gap_yaw)
            work[h].log_weight = -0.5 * turned * turned / (row.gap_yaw_var + unwatched_turn(row.gap_unheard))
    row.referred = 1
    if not is_referred(node.heading_kind):
        return ring + _aligned(work, ring, row, t)
    _, slow, _ = error_of(row, node.heading_var)
    give_reference_error(work[0].cov, slow, not given)
    return ring + second_class(work, 0, ring, row, t, not given)


@njit(nogil=True)
def second_class(work: Any, source: int, target: int, row: Any, t: Tuning, yaw_follows: bool) -> int:
    """A copy of `source` whose heading reference has a slow error of its own, or drifts; returns how many."""
    if told_of(row):
        return 0
    copy_hypothesis(work, source, target)
    work[target].kind = OWN_ERROR
    if row.model == STEADY:
        work[target].log_weight += t.drift_log_prior
        work[target].cov[GYRO, GYRO] = t.drift_std**2
    else:
        work[target].log_weight += t.second_class
        give_reference_error(work[target].cov, t.second_std, yaw_follows)
    return 1


@njit(nogil=True)
def blame_gyro(work: Any, count: int, model: int, slow: float, t: Tuning) -> int:
    """Heading and gyroscope drift apart: copies for which it is the gyroscope, as likely as not; the ranges decide.

    Where the heading's error is not white after all, those hypotheses take that error. Returns the count.
    """
    old = count
    blamed = False
    for h in range(old):
        blamed |= work[h].kind == DRIFTING
    for h in range(old):
        if model == WANDERING and not blamed and work[h].kind == EXACT and count < KEEP:
            copy_hypothesis(work, h, count)
            work[count].kind = DRIFTING
            work[count].log_weight += t.drift_again
            count += 1
        elif model != WANDERING and slow > 0.0 and work[h].kind == DRIFTING:
            work[h].kind = EXACT
            give_reference_error(work[h].cov, slow, False)
    return count


@njit(nogil=True)
def first_class(work: Any, source: int, target: int, PH: Any, t: Tuning) -> int:
    """A copy of `source`, of the second class, with an exact heading reference after all; returns 1.

    Its weight is the Savage-Dickey ratio: posterior over prior density of the reference's error at zero.
    """
    copy_hypothesis(work, source, target)
    new = work[target]
    new.kind = EXACT
    error, variance = new.mean[REF], max(new.cov[REF, REF], 1e-9)
    new.log_weight += 0.5 * math.log(t.second_std**2 / variance) - 0.5 * error * error / variance - t.second_class
    update_component(new.mean, new.cov, PH, REF, 0.0, 1e-8)
    for i in range(N):
        new.cov[REF, i] = new.cov[i, REF] = 0.0
    new.mean[REF] = 0.0
    return 1


@njit(nogil=True)
def reseed(work: Any, count: int, row: Any, node: Any, PH: Any, t: Tuning) -> int:
    """Keep both classes alive while tracking: a reference with an error of its own, and one without."""
    if row.declared == 0 or count >= KEEP:
        return count
    wrong = 0
    for h in range(count):
        wrong += work[h].kind == OWN_ERROR
    best = best_of(work, count)
    if wrong == 0:
        added = second_class(work, best, count, row, t, False)
        work[count].log_weight += t.second_again
        return count + added
    _, slow, _ = error_of(row, node.heading_var)
    if wrong == count and slow == 0.0:
        return count + first_class(work, best, count, PH, t)
    return count


@njit(nogil=True)
def start_ring(work: Any, row: Any, horizontal: float, node: Any, at_rest: bool, t: Tuning) -> int:
    """Bearings x speeds with a standard deviation of half a cell; speeds forward unless reverse is allowed."""
    signs = 2 if row.reverse == 1 and not at_rest else 1
    bearings = _bearings(row, t)
    speeds = 1 if at_rest else (t.coarse_speeds if row.coarse == 1 else t.ring_speeds) // signs  # within KEEP always
    top = min(t.ring_speed_max, row.v_max)
    cell = 2.0 * math.pi / bearings
    choose_model(row, node, t)
    row.referred = 1 if is_referred(node.heading_kind) else 0
    variance = node.heading_var if row.referred == 1 else 1e-4
    h = 0
    for i in range(bearings):
        for k in range(speeds):
            for g in range(signs):
                _common(work, h, row, node, node.heading, variance, t)
                s, P = work[h].mean, work[h].cov
                s[R], s[PHI] = horizontal, cell * i
                P[R, R] = row.range_std**2 / 4.0 + row.offset_std**2
                P[R, OFFSET] = P[OFFSET, R] = -(row.offset_std**2)
                P[PHI, PHI] = (cell / 2.0) ** 2
                # an error of the mounting angle turns everything about the anchor: the ring covers the angle between
                P[PHI, PHI] += row.mount_std**2
                P[PHI, MOUNT] = P[MOUNT, PHI] = row.mount_std**2
                speed_cell = top / speeds
                s[V] = 0.0 if at_rest else (1.0 - 2.0 * g) * speed_cell * (k + 0.5)
                P[V, V] = 0.01 if at_rest else (speed_cell / 2.0) ** 2
                if row.referred == 1:
                    _, slow, _ = error_of(row, node.heading_var)
                    turn_about(P, slow)
                h += 1
    return h


@njit(nogil=True)
def median(values: Any, count: int) -> float:
    """Of the first `count`."""
    return float(np.median(values[:count]))


@njit(nogil=True)
def begin(work: Any, row: Any, node: Any, anchors: Any, t: Tuning) -> int:
    """Collect what a start needs and make the first hypotheses; returns their count."""
    row.ring_s += node.dt_s
    if node.kind == RANGE and row.anchor < 0:
        row.anchor = node.anchor
    if node.heading_kind == NO_HEADING:
        row.reason = 1
        return 0
    if node.heading_kind == MEASURED_HEADING and row.hm_started == 0:
        reset_models(row, node.heading, node.heading_var, t)
    if row.anchor < 0:
        row.reason = 0
        return 0
    anchor = anchors[row.anchor]
    if row.start_known == 1 or row.again == 1:
        return start_known(work, row, anchor, node, t)
    if node.kind == RANGE and node.anchor == row.anchor:
        row.ring[row.ring_count % RING_RANGES] = node.z / row.range_scale - row.offset
        row.ring_count += 1
    if row.ring_count < 5 or (row.ring_count < RING_RANGES and row.ring_s < 1.0):
        row.reason = 0
        return 0
    slant = median(row.ring, min(row.ring_count, RING_RANGES))
    horizontal = math.sqrt(max(slant**2 - (row.height - anchor.z) ** 2, 0.01))
    return start_ring(work, row, horizontal, node, node.rest == 1, t)
