"""A line of sight that is lost for seconds, and a track that has lost its ranges.

Without line of sight every range is too long by one nearly constant amount. A second hypothesis with a larger range
bias keeps what such ranges still say. It is born when several ranges in a row are too long, and loses weight by time to
one with a line of sight again.
"""

from typing import Final

from dropanchor_service.estimation.fleet.belief.births.forgetting import RUNS, forget
from dropanchor_service.estimation.fleet.belief.births.numbers import (
    RING_AGAIN,
    SIGHT_BACK,
    SIGHT_EXPECTED,
    SIGHT_LOST,
    WIDENED,
)
from dropanchor_service.estimation.fleet.belief.layout import (
    PHI,
    RANGE_BIAS,
    Hypotheses,
    R,
    Row,
    V,
)
from dropanchor_service.estimation.fleet.belief.mixture import LIGHT, best_of, clear_state, copy_hypothesis, gets_child
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning, is_on

OFFER_EVERY: Final = 1.0  # s between offers of a line of sight
MISFIT_LIMIT: Final = 0.5  # mean outlier probability above which most ranges are outliers
AGREEMENT: Final = 0.2  # mean outlier probability below which the ranges agree with the track
MAX_WIDENED: Final = 2  # times that a track is widened before it is given up
WIDEN_POSITION, WIDEN_SPEED = 1.0, 0.5  # m^2 and (m/s)^2 by which a track with a misfit is widened


@njit(nogil=True)
def follow_jumps(work: Hypotheses, count: int, row: Row, t: Tuning) -> int:
    """Lose and find lines of sight where several ranges in a row were too long or too short. Return the count."""
    longer = row.nlos.high_run >= t.nlos_run
    if longer or row.nlos.low_run >= t.nlos_run:
        top = work[best_of(work, count)].log_weight
        for h in range(count):
            if (longer or work[h].nlos == 1) and is_on(SIGHT_LOST, t) and gets_child(work, h, count, top, LIGHT):
                copy_nlos(work, h, count, t)
                count += 1
            if work[h].nlos == 1 and not longer and is_on(SIGHT_BACK, t) and gets_child(work, h, count, top, LIGHT):
                copy_los(work, h, count, t)
                count += 1
        forget(row, RUNS)
    return count


@njit(nogil=True)
def copy_nlos(work: Hypotheses, source: int, target: int, t: Tuning) -> None:
    """Copy `source` for a path that is longer than the line of sight by about the mean of an outlier."""
    copy_hypothesis(work, source, target)
    new = work[target]
    if new.nlos == 0:
        new.los_bias, new.los_bias_var = new.mean[RANGE_BIAS], new.cov[RANGE_BIAS, RANGE_BIAS]
        new.nlos = 1
    new.mean[RANGE_BIAS] = new.los_bias + t.outlier_mean
    clear_state(new.cov, RANGE_BIAS, new.los_bias_var + t.outlier_std**2)
    new.log_weight += t.nlos_log_prior


@njit(nogil=True)
def copy_los(work: Hypotheses, source: int, target: int, t: Tuning) -> None:
    """Copy `source` for a line of sight that is back, with the range bias from before it was lost."""
    copy_hypothesis(work, source, target)
    new = work[target]
    new.nlos = 0
    new.mean[RANGE_BIAS] = new.los_bias
    clear_state(new.cov, RANGE_BIAS, new.los_bias_var)
    new.log_weight += t.nlos_log_prior


@njit(nogil=True)
def expect_sight(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Offer a line of sight now and then, though no jump shows it. Lost ones come back at the rate 1/nlos_tau."""
    row.nlos.since_los_offer_s += node.dt_s
    if row.nlos.since_los_offer_s >= OFFER_EVERY:
        row.nlos.since_los_offer_s = 0.0
        top = work[best_of(work, count)].log_weight
        for h in range(count):
            if work[h].nlos == 1 and is_on(SIGHT_EXPECTED, t) and gets_child(work, h, count, top, LIGHT):
                copy_los(work, h, count, t)
                count += 1
    for h in range(count):
        if work[h].nlos == 1:
            work[h].log_weight -= node.dt_s / t.nlos_tau
    return count


@njit(nogil=True)
def widen_after_misfit(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> None:
    """Widen a track whose ranges have been outliers for seconds: the ranges are right and the track is wrong."""
    nlos = row.nlos
    nlos.misfit_s = nlos.misfit_s + node.dt_s if nlos.misfit > MISFIT_LIMIT else 0.0
    if nlos.misfit < AGREEMENT:
        nlos.widened = 0
    if nlos.misfit_s < t.misfit_s or not is_on(WIDENED, t):
        return
    nlos.misfit_s = 0.0
    nlos.widened += 1
    for h in range(count):
        P = work[h].cov
        P[R, R] += WIDEN_POSITION
        P[PHI, PHI] += WIDEN_POSITION / max(work[h].mean[R], 1.0) ** 2
        P[V, V] += WIDEN_SPEED


@njit(nogil=True)
def contradicts_ranges(work: Hypotheses, count: int, row: Row, t: Tuning) -> bool:
    """Return whether the track is wrong: ranges stay outliers, or only a long detour would explain them.

    A lost line of sight makes a range longer by a metre or so. A track that has gone wrong needs a larger extra bias
    as it moves away from the tag, and would take it for the path of the signal for ever.
    """
    best = work[best_of(work, count)]
    extra = best.mean[RANGE_BIAS] - best.los_bias if best.nlos == 1 else 0.0
    wrong = row.nlos.widened >= MAX_WIDENED or extra > t.nlos_max_bias
    return bool(wrong and is_on(RING_AGAIN, t))
