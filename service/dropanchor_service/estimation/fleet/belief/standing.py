"""What a standstill begins and ends: a rest that may be a smooth ride, and a tag that may drive off backwards."""

import math
from typing import Final

from dropanchor_service.estimation.fleet.angles import TWO_PI
from dropanchor_service.estimation.fleet.belief.layout import MAX_HYPOTHESES, Hypotheses, Row, V
from dropanchor_service.estimation.fleet.belief.mixture import best_of, copy_hypothesis
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MOVING, RESTING, Node
from dropanchor_service.estimation.fleet.tuning import Tuning

SPEEDS: Final = 2.5  # m/s, over which the speed of a moving tag is spread
CERTAIN: Final = 3.0  # standard deviations from zero at which a tag certainly moves
LIKELY: Final = 0.01  # weight from which on a hypothesis may deny that the tag moves
QUIET_TAU: Final = 10.0  # s, over which the share of quiet motion is averaged
QUIET_START, QUIET_MIN = 0.05, 0.005  # that share before any motion, and the least of it
STOOD_S: Final = 0.1  # s of rest after which a tag may drive off in the other direction
SLOW: Final = 0.2  # m/s, of a tag that hardly moves
SLOW_EVERY: Final = 0.5  # s
EVEN: Final = -0.7  # log of one half
REFUSED: Final = 2.0  # standard deviations of speed in the other direction that are not noise
TURNABOUT_DEPTH: Final = 8.0  # log weight below the best at which a hypothesis is not offered the other direction


@njit(nogil=True)
def judge_standstill(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> None:
    """Take the node's rest back if the tag more likely rolls. work: before the node.

    A smooth ride at constant speed looks like rest to accelerometer and gyroscope. So the speeds decide, and how often
    this tag has looked like that while it certainly moved:

        mean of N(0; speed, variance) over the hypotheses  against  P(quiet | moving) / SPEEDS
    """
    quiet = node.rest == RESTING
    if not quiet and row.quiet_share == QUIET_MIN:
        return
    total, at_rest, certain = 0.0, 0.0, True
    for h in range(count):
        weight, speed, variance = math.exp(work[h].log_weight), work[h].mean[V], work[h].cov[V, V] + t.rest_std**2
        total += weight
        at_rest += weight * math.exp(-0.5 * speed * speed / variance) / math.sqrt(TWO_PI * variance)
        if abs(speed) <= max(CERTAIN * math.sqrt(variance), SLOW) and weight > LIKELY:
            certain = False
    if certain:
        share = node.dt_s / (QUIET_TAU + node.dt_s)
        row.quiet_share = max(row.quiet_share + share * (quiet - row.quiet_share), QUIET_MIN)
    if quiet and at_rest < total * row.quiet_share / SPEEDS:
        node.rest = MOVING


@njit(nogil=True)
def offer_turnabout(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Let a tag that stood drive off in the other direction. Return the count of hypotheses.

    At rest there is no direction. Only an accelerometer tells the two apart soon enough.
    """
    stood = row.stood_s >= STOOD_S
    row.stood_s = row.stood_s + node.dt_s if node.rest == RESTING else 0.0
    if node.rest == RESTING:
        for h in range(count):
            work[h].reverse = 0
        return count
    if node.carried == 1 or not math.isfinite(node.dv_var):
        return count
    row.since_turnabout_s += node.dt_s
    count = _offer_while_slow(work, count, row, t)
    if not stood:
        return count
    prior = 0.0 if row.settings.reverse_allowed == 1 else t.reverse_log_prior
    floor = work[best_of(work, count)].log_weight - TURNABOUT_DEPTH
    for h in range(count):
        if work[h].log_weight > floor and count < MAX_HYPOTHESES:
            count = _add_turned(work, h, count, prior)
    return count


@njit(nogil=True)
def offer_refused(work: Hypotheses, count: int, node: Node, t: Tuning) -> int:
    """Let a tag turn back whose accelerometer says so, though no rest was seen: some stops are too short.

    Call it before the speed is truncated to the direction of each hypothesis. Return the count of hypotheses.
    """
    if node.carried == 1 or not math.isfinite(node.dv_var):
        return count
    for h in range(count):
        ahead = work[h].mean[V] if work[h].reverse == 0 else -work[h].mean[V]
        if ahead + t.reverse_slack < -REFUSED * math.sqrt(work[h].cov[V, V]) and count < MAX_HYPOTHESES:
            count = _add_turned(work, h, count, t.reverse_log_prior)
    return count


@njit(nogil=True)
def _add_turned(work: Hypotheses, source: int, target: int, log_prior: float) -> int:
    """Copy `source` for the other direction. Return the count of hypotheses."""
    copy_hypothesis(work, source, target)
    work[target].reverse = 1 - work[source].reverse
    work[target].log_weight += log_prior
    return target + 1


@njit(nogil=True)
def _offer_while_slow(work: Hypotheses, count: int, row: Row, t: Tuning) -> int:
    """Let a tag turn back that has slowed down, whether it stands or not. Return the count of hypotheses.

    One that reverses may drive ahead; one that drives ahead may reverse only if the operator says that it does.
    """
    if row.since_turnabout_s < SLOW_EVERY:
        return count
    allowed = row.settings.reverse_allowed == 1
    for h in range(count):
        s, deviation = work[h].mean, math.sqrt(work[h].cov[V, V])
        if work[h].reverse == 1 and s[V] > -SLOW / 2 and count < MAX_HYPOTHESES:
            row.since_turnabout_s = 0.0
            work[h].log_weight += EVEN
            count = _add_turned(work, h, count, 0.0)
        elif allowed and work[h].reverse == 0 and s[V] < max(SLOW / 2, deviation) and count < MAX_HYPOTHESES:
            row.since_turnabout_s = 0.0
            count = _add_turned(work, h, count, t.reverse_log_prior)
    return count
