"""What a standstill begins and ends: a rest that may be a smooth ride, and a tag that may drive off backwards."""

import math
from typing import Final

from dropanchor_service.estimation.fleet.angles import TWO_PI
from dropanchor_service.estimation.fleet.belief.layout import MAX_HYPOTHESES, Hypotheses, Hypothesis, Row, V
from dropanchor_service.estimation.fleet.belief.mixture import best_of, copy_hypothesis
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MOVING, RESTING, Node
from dropanchor_service.estimation.fleet.tuning import Tuning

SPEEDS: Final = 2.5  # m/s, over which the speed of a moving tag is spread
CERTAIN: Final = 3.0  # standard deviations from zero at which a tag certainly moves
QUIET_TAU: Final = 10.0  # s, over which the share of quiet motion is averaged
QUIET_START, QUIET_MIN = 0.05, 0.005  # that share before any motion, and the least of it
STOOD_S: Final = 0.1  # s of rest after which a tag may drive off in the other direction
SLOW: Final = 0.2  # m/s, of a tag that hardly moves
AHEAD_AGAIN_EVERY: Final = 0.5  # s
EVEN: Final = -0.7  # log of one half
TURNABOUT_DEPTH: Final = 4.0  # log weight below the best at which a hypothesis is not offered the other direction


@njit(nogil=True)
def judge_standstill(one: Hypothesis, row: Row, node: Node, t: Tuning) -> None:
    """Take the node's rest back if the tag more likely rolls. one: the best hypothesis, before the node.

    A smooth ride at constant speed looks like rest to accelerometer and gyroscope. So the speed decides, and how often
    this tag has looked like that while it certainly moved:

        N(0; speed, variance)  against  P(quiet | moving) / SPEEDS
    """
    speed, variance = one.mean[V], one.cov[V, V] + t.rest_std**2
    quiet = node.rest == RESTING
    if abs(speed) > max(CERTAIN * math.sqrt(variance), SLOW):
        share = node.dt_s / (QUIET_TAU + node.dt_s)
        row.quiet_share = max(row.quiet_share + share * (quiet - row.quiet_share), QUIET_MIN)
    at_rest = -0.5 * speed * speed / variance - 0.5 * math.log(TWO_PI * variance)
    if quiet and at_rest < math.log(row.quiet_share / SPEEDS):
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
    if row.settings.reverse_allowed == 1 or node.carried == 1:
        return count
    row.since_turnabout_s += node.dt_s
    count = _offer_ahead_again(work, count, row)
    if not math.isfinite(node.dv_var) or not stood:
        return count
    floor = work[best_of(work, count)].log_weight - TURNABOUT_DEPTH
    for h in range(count):
        if work[h].log_weight > floor and count < MAX_HYPOTHESES:
            copy_hypothesis(work, h, count)
            work[count].reverse = 1 - work[h].reverse
            work[count].log_weight += t.reverse_log_prior
            count += 1
    return count


@njit(nogil=True)
def _offer_ahead_again(work: Hypotheses, count: int, row: Row) -> int:
    """Let a tag that has slowed down while it reversed drive ahead, whether it stands or not. Return the count."""
    if row.since_turnabout_s < AHEAD_AGAIN_EVERY:
        return count
    for h in range(count):
        if work[h].reverse == 1 and work[h].mean[V] > -SLOW / 2 and count < MAX_HYPOTHESES:
            row.since_turnabout_s = 0.0
            work[h].log_weight += EVEN
            copy_hypothesis(work, h, count)
            work[count].reverse = 0
            count += 1
    return count
