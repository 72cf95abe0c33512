"""A line of sight that is lost for seconds, and a track that has lost its ranges.

Without line of sight every range is too long by one nearly constant amount. A second hypothesis with a larger range
bias keeps what such ranges still say. It is added when several ranges in a row are too long, and closed when the bias
is that of a line of sight again.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.layout import (
    MAX_HYPOTHESES,
    PHI,
    RANGE_BIAS,
    Floats,
    Hypotheses,
    N,
    R,
    Row,
    V,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of, copy_hypothesis
from dropanchor_service.estimation.fleet.belief.update import update_component
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning

OFFER_EVERY: Final = 1.0  # s between offers of a line of sight
MISFIT_LIMIT: Final = 0.5  # mean outlier probability above which most ranges are outliers
CLOSE_SIGMAS, CLOSE_SLACK = 1.5, 0.2  # standard deviations and m within which a bias is that of a line of sight
AGREEMENT: Final = 0.2  # mean outlier probability below which the ranges agree with the track
MAX_WIDENED: Final = 2  # times that a track is widened before it is given up
WIDEN_POSITION, WIDEN_SPEED = 1.0, 0.5  # m^2 and (m/s)^2 by which a track with a misfit is widened


@njit(nogil=True)
def propose_alternatives(work: Hypotheses, count: int, row: Row, t: Tuning) -> int:
    """Add an alternative to every likely hypothesis when the ranges jump. Return the count.

    Ranges that are too long: the line of sight is lost, or the path grew longer. Ranges that are too short: the line of
    sight is back, or the path grew shorter.
    """
    too_long = row.nlos.high_run >= t.nlos_run
    if not too_long and row.nlos.low_run < t.nlos_run:
        return count
    row.nlos.high_run = row.nlos.low_run = 0
    floor = work[best_of(work, count)].log_weight - t.nlos_depth
    for h in range(count):
        if work[h].log_weight < floor:
            continue
        if (too_long or work[h].nlos == 1) and count < MAX_HYPOTHESES:
            _add_nlos(work, h, count, t)
            count += 1
        if not too_long and work[h].nlos == 1 and count < MAX_HYPOTHESES:
            _add_los(work, h, count, t)
            count += 1
    return count


@njit(nogil=True)
def _add_nlos(work: Hypotheses, source: int, target: int, t: Tuning) -> None:
    """Copy `source` for a path that is longer than the line of sight by about the mean of an outlier."""
    copy_hypothesis(work, source, target)
    new = work[target]
    new.log_weight += t.nlos_log_prior
    if new.nlos == 0:
        new.los_bias, new.los_bias_var = new.mean[RANGE_BIAS], new.cov[RANGE_BIAS, RANGE_BIAS]
        new.nlos = 1
    _decorrelate_bias(new.cov)
    new.mean[RANGE_BIAS] = new.los_bias + t.outlier_mean
    new.cov[RANGE_BIAS, RANGE_BIAS] = new.los_bias_var + t.outlier_std**2


@njit(nogil=True)
def _add_los(work: Hypotheses, source: int, target: int, t: Tuning) -> None:
    """Copy `source` for a line of sight that is back, with the range bias from before it was lost."""
    copy_hypothesis(work, source, target)
    new = work[target]
    new.log_weight += t.nlos_log_prior
    new.nlos = 0
    _decorrelate_bias(new.cov)
    new.mean[RANGE_BIAS] = new.los_bias
    new.cov[RANGE_BIAS, RANGE_BIAS] = new.los_bias_var


@njit(nogil=True)
def _decorrelate_bias(P: Floats) -> None:
    for i in range(N):
        P[RANGE_BIAS, i] = P[i, RANGE_BIAS] = 0.0


@njit(nogil=True)
def expect_los(work: Hypotheses, count: int, row: Row, dt: float, t: Tuning) -> int:
    """Let lost lines of sight come back at the rate 1/nlos_tau, whether a jump shows it or not. Return the count."""
    row.nlos.since_los_offer_s += dt
    offer = row.nlos.since_los_offer_s >= OFFER_EVERY
    if offer:
        row.nlos.since_los_offer_s = 0.0
    floor = work[best_of(work, count)].log_weight - t.nlos_depth
    for h in range(count):
        if work[h].nlos == 1:
            if offer and work[h].log_weight > floor and count < MAX_HYPOTHESES:
                _add_los(work, h, count, t)
                count += 1
            work[h].log_weight -= dt / t.nlos_tau
    return count


@njit(nogil=True)
def widen_after_misfit(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> None:
    """Widen a track whose ranges have been outliers for seconds: the ranges are right and the track is wrong."""
    nlos = row.nlos
    nlos.misfit_s = nlos.misfit_s + node.dt_s if nlos.misfit > MISFIT_LIMIT else 0.0
    if nlos.misfit < AGREEMENT:
        nlos.widened = 0
    if nlos.misfit_s < t.misfit_s:
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
    return bool(row.nlos.widened >= MAX_WIDENED or extra > t.nlos_max_bias)


@njit(nogil=True)
def close_nlos(work: Hypotheses, count: int, PH: Floats, t: Tuning) -> None:
    """Turn NLOS hypotheses whose extra bias has gone into ones with the bias of a line of sight."""
    for h in range(count):
        if work[h].nlos == 1:
            extra = work[h].mean[RANGE_BIAS] - work[h].los_bias
            sigma = math.sqrt(work[h].cov[RANGE_BIAS, RANGE_BIAS])
            certain = extra + 2.0 * sigma < t.nlos_min_bias + CLOSE_SLACK
            if certain and extra < min(t.nlos_min_bias, CLOSE_SIGMAS * sigma):
                work[h].nlos = 0
                variance = max(work[h].los_bias_var, 1e-6)
                update_component(work[h].mean, work[h].cov, PH, RANGE_BIAS, work[h].los_bias, variance)
