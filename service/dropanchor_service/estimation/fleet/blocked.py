"""A line of sight that is blocked for seconds, and a track that has lost its ranges.

A blocked line of sight lengthens every range by one nearly constant amount: a second hypothesis with a larger range
offset keeps what such ranges still say. It is opened when several ranges in a row are too long, closed when they fall.
"""

import math
from typing import Any

from .compiled import njit
from .layout import KEEP, OFFSET, PHI, N, R, V
from .manage import best_of, copy_hypothesis
from .tuning import Tuning


@njit(nogil=True)
def open_alternative(work: Any, count: int, row: Any, t: Tuning) -> int:
    """Open a hypothesis of a blocked line of sight when ranges jump up, of a clear one when they jump down again."""
    if row.high_run < t.blocked_run and row.low_run < t.blocked_run:
        return count
    blocked = row.high_run >= t.blocked_run
    row.high_run = row.low_run = 0
    source = best_of(work, count)
    if count >= KEEP or (work[source].blocked == 0) != blocked:
        return count
    copy_hypothesis(work, source, count)
    s, P = work[count].mean, work[count].cov
    work[count].log_weight += t.blocked_log_prior
    for i in range(N):
        P[OFFSET, i] = P[i, OFFSET] = 0.0
    if blocked:
        work[count].clear[0], work[count].clear[1] = s[OFFSET], work[source].cov[OFFSET, OFFSET]
        s[OFFSET] += t.outlier_mean
        P[OFFSET, OFFSET] = work[count].clear[1] + t.outlier_std**2
        work[count].blocked = 1
    else:
        s[OFFSET] = work[count].clear[0]
        P[OFFSET, OFFSET] = work[count].clear[1]
        work[count].blocked = 0
    return count + 1


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
def unblock(work: Any, count: int, t: Tuning) -> None:
    """A blocked hypothesis whose extra offset has gone is a clear one."""
    for h in range(count):
        if work[h].blocked == 1:
            extra = work[h].mean[OFFSET] - work[h].clear[0]
            if extra + 2.0 * math.sqrt(work[h].cov[OFFSET, OFFSET]) < t.blocked_min + 0.2 and extra < t.blocked_min:
                work[h].blocked = 0
