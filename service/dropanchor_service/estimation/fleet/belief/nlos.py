"""A line of sight that is blocked for seconds, and a track that has lost its ranges.

A blocked line of sight lengthens every range by one nearly constant amount: a second hypothesis with a larger range
offset keeps what such ranges still say. It is opened when several ranges in a row are too long, closed when they fall.
"""

import math
from typing import Any

from dropanchor_service.estimation.fleet.belief.layout import KEEP, OFFSET, PHI, N, R, V
from dropanchor_service.estimation.fleet.belief.mixture import best_of, copy_hypothesis
from dropanchor_service.estimation.fleet.belief.update import update_component
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def open_alternative(work: Any, count: int, row: Any, t: Tuning) -> int:
    """Alternatives of every likely hypothesis when ranges jump: up, the line of sight is blocked (or blocked by
    more); down, it is clear again (or blocked by less). Returns the count."""
    up = row.high_run >= t.blocked_run
    if not up and row.low_run < t.blocked_run:
        return count
    row.high_run = row.low_run = 0
    floor = work[best_of(work, count)].log_weight - t.blocked_depth
    for h in range(count):
        if work[h].log_weight < floor:
            continue
        if (up or work[h].blocked == 1) and count < KEEP:
            _block(work, h, count, t)
            count += 1
        if not up and work[h].blocked == 1 and count < KEEP:
            _clear(work, h, count, t)
            count += 1
    return count


@njit(nogil=True)
def _block(work: Any, source: int, target: int, t: Tuning) -> None:
    copy_hypothesis(work, source, target)
    new = work[target]
    new.log_weight += t.blocked_log_prior
    if new.blocked == 0:
        new.clear[0], new.clear[1] = new.mean[OFFSET], new.cov[OFFSET, OFFSET]
        new.blocked = 1
    _forget_offset(new.cov)
    new.mean[OFFSET] = new.clear[0] + t.outlier_mean
    new.cov[OFFSET, OFFSET] = new.clear[1] + t.outlier_std**2


@njit(nogil=True)
def _clear(work: Any, source: int, target: int, t: Tuning) -> None:
    copy_hypothesis(work, source, target)
    new = work[target]
    new.log_weight += t.blocked_log_prior
    new.blocked = 0
    _forget_offset(new.cov)
    new.mean[OFFSET] = new.clear[0]
    new.cov[OFFSET, OFFSET] = new.clear[1]


@njit(nogil=True)
def _forget_offset(P: Any) -> None:
    for i in range(N):
        P[OFFSET, i] = P[i, OFFSET] = 0.0


@njit(nogil=True)
def expect_clear(work: Any, count: int, row: Any, dt: float, t: Tuning) -> int:
    """Blocked lines of sight clear at a rate of 1/blocked_tau, whether a jump shows it or not; returns the count."""
    row.since_clear_s += dt
    offer = row.since_clear_s >= 1.0
    if offer:
        row.since_clear_s = 0.0
    floor = work[best_of(work, count)].log_weight - t.blocked_depth
    for h in range(count):
        if work[h].blocked == 1:
            if offer and work[h].log_weight > floor and count < KEEP:
                _clear(work, h, count, t)
                count += 1
            work[h].log_weight -= dt / t.blocked_tau
    return count


@njit(nogil=True)
def recover(work: Any, count: int, row: Any, node: Any, t: Tuning) -> None:
    """Ranges that have been refused for seconds are right and the track is wrong: widen it."""
    row.since_nlos_s = row.since_nlos_s + node.dt_s if row.misfit > 0.5 else 0.0
    if row.since_nlos_s < t.misfit_s:
        return
    row.since_nlos_s = 0.0
    for h in range(count):
        P = work[h].cov
        P[R, R] += 1.0
        P[PHI, PHI] += 1.0 / max(work[h].mean[R], 1.0) ** 2
        P[V, V] += 0.5


@njit(nogil=True)
def unblock(work: Any, count: int, PH: Any, t: Tuning) -> None:
    """A blocked hypothesis whose extra offset has gone is a clear one, with the offset of a clear line of sight."""
    for h in range(count):
        if work[h].blocked == 1:
            extra = work[h].mean[OFFSET] - work[h].clear[0]
            sigma = math.sqrt(work[h].cov[OFFSET, OFFSET])
            if extra + 2.0 * sigma < t.blocked_min + 0.2 and extra < min(t.blocked_min, 1.5 * sigma):
                work[h].blocked = 0
                variance = max(work[h].clear[1], 1e-6)
                update_component(work[h].mean, work[h].cov, PH, OFFSET, work[h].clear[0], variance)
