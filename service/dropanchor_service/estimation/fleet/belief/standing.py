"""A rest that may be a smooth ride."""

import math
from typing import Final

from dropanchor_service.estimation.fleet.angles import TWO_PI
from dropanchor_service.estimation.fleet.belief.layout import Hypotheses, Row, V
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MOVING, RESTING, Node
from dropanchor_service.estimation.fleet.tuning import Tuning

SPEEDS: Final = 2.5  # m/s, over which the speed of a moving tag is spread
CERTAIN: Final = 3.0  # standard deviations from zero at which a tag certainly moves
LIKELY: Final = 0.01  # weight from which on a hypothesis may deny that the tag moves
QUIET_TAU: Final = 10.0  # s, over which the share of quiet motion is averaged
QUIET_START, QUIET_MIN = 0.4, 0.005  # that share before any motion: an IMU may filter vibration; and the least of it
SLOW: Final = 0.2  # m/s, of a tag that hardly moves


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
