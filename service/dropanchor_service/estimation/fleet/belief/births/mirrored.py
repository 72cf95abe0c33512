"""A start that an anchor with two antennas measures: ahead of it, or at the mirror image behind it."""

import math

from dropanchor_service.estimation.fleet.belief.births.numbers import MIRRORED_START
from dropanchor_service.estimation.fleet.belief.layout import MAX_HYPOTHESES, PHI, Hypotheses, R, Row
from dropanchor_service.estimation.fleet.belief.mixture import copy_hypothesis, keep_heaviest, normalise
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning, is_on


@njit(nogil=True)
def is_mirrored(row: Row) -> bool:
    """Return whether a row may be at either of two places since its start."""
    return bool(row.start.known == 1 and math.isfinite(row.start.other_x))


@njit(nogil=True)
def start_at_both(work: Hypotheses, count: int, row: Row, t: Tuning) -> int:
    """Copy all hypotheses to the other place where a tag may start as well. Return their count."""
    start = row.start
    if not is_mirrored(row) or not is_on(MIRRORED_START, t):
        return count
    count = keep_heaviest(work, count, MAX_HYPOTHESES // 2)
    for h in range(count):
        copy_hypothesis(work, h, count + h)
        s, P = work[count + h].mean, work[count + h].cov
        x = s[R] * math.cos(s[PHI]) + start.other_x - start.x
        y = s[R] * math.sin(s[PHI]) + start.other_y - start.y
        r = max(math.hypot(x, y), 1e-3)
        P[PHI, PHI] *= (s[R] / r) ** 2
        s[R], s[PHI] = r, math.atan2(y, x)
    normalise(work, 2 * count)  # neither of the places is certain
    return 2 * count
