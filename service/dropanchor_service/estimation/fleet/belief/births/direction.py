"""In which direction a tag drives along its course: one that stops or is pushed back may turn back.

At rest there is no direction. Only an accelerometer tells the two apart soon enough. One that is merely slow turns back
in no hypothesis: past the anchor that would be a mirror image, which ranges and a bias of the accelerometer explain.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.births.numbers import PUSHED_BACK, SLOW_AHEAD, TURN_AFTER_STOP
from dropanchor_service.estimation.fleet.belief.layout import Hypotheses, Hypothesis, Row, V
from dropanchor_service.estimation.fleet.belief.mixture import best_of, copy_hypothesis, gets_child
from dropanchor_service.estimation.fleet.belief.rigidity import is_mount_untold
from dropanchor_service.estimation.fleet.belief.start import starts_at_place
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import RESTING, Node
from dropanchor_service.estimation.fleet.measurement.rest import SLOW
from dropanchor_service.estimation.fleet.tuning import Tuning, is_on

STOOD_S: Final = 0.1  # s of rest after which a tag may drive off in the other direction
SLOW_EVERY: Final = 0.5  # s
EVEN: Final = -0.7  # log of one half
REFUSED: Final = 2.0  # standard deviations of speed in the other direction that are not noise
DRIVEN: Final = 0.5  # m from the start after which a tag has a direction to turn back from
TURNABOUT_DEPTH: Final = 8.0  # log weight below the best at which a hypothesis is not offered the other direction


@njit(nogil=True)
def _is_either_way(row: Row, t: Tuning) -> bool:
    """Return whether a tag has not driven yet since a start with mounting angles all around.

    There, one that drives off backwards is the one that is mounted the other way round.
    """
    return bool(starts_at_place(row) and row.settings.mount_angle_std > t.mount_cell and row.start.way < DRIVEN)


@njit(nogil=True)
def can_turn(node: Node) -> bool:
    """Return whether the node's accelerations tell how a vehicle drives."""
    return bool(node.carried == 0 and math.isfinite(node.dv_var))


@njit(nogil=True)
def may_reverse(row: Row, t: Tuning) -> bool:
    """Return whether a tag moves backwards as easily as ahead: it is told to, or it may be mounted backwards."""
    return bool(row.settings.reverse_allowed == 1 or is_mount_untold(row, t))


@njit(nogil=True)
def _turn(work: Hypotheses, source: int, target: int, log_prior: float) -> None:
    """Copy `source` for the other direction."""
    copy_hypothesis(work, source, target)
    work[target].reverse = 1 - work[source].reverse
    work[target].log_weight += log_prior


@njit(nogil=True)
def turn_back(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Let tags that slowed down, or drive off after a stop, turn back. Return the count."""
    if not can_turn(node) or node.rest == RESTING or _is_either_way(row, t):
        return count
    row.since_turnabout_s += node.dt_s
    if is_on(SLOW_AHEAD, t) and row.since_turnabout_s >= SLOW_EVERY:
        for h in range(count):
            slow = work[h].reverse == 1 and work[h].mean[V] > -SLOW / 2
            if slow and gets_child(work, h, count, 0.0, math.inf):
                _turn(work, h, count, EVEN)
                work[h].log_weight += EVEN
                row.since_turnabout_s = 0.0
                count += 1
    if is_on(TURN_AFTER_STOP, t) and row.stood_s >= STOOD_S:
        top, log_prior = work[best_of(work, count)].log_weight, 0.0 if may_reverse(row, t) else t.reverse_log_prior
        for h in range(count):
            if gets_child(work, h, count, top, TURNABOUT_DEPTH):
                _turn(work, h, count, log_prior)
                count += 1
    return count


@njit(nogil=True)
def push_back(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Let tags turn back of which the accelerometer says so though no rest was seen: some stops are too short.

    Ask before the speed is truncated to the direction of the hypothesis. Return the count.
    """
    if not is_on(PUSHED_BACK, t) or not can_turn(node) or _is_either_way(row, t):
        return count
    for h in range(count):
        one = work[h]
        ahead = one.mean[V] if one.reverse == 0 else -one.mean[V]
        pushed = ahead + t.reverse_slack < -REFUSED * math.sqrt(one.cov[V, V])
        if pushed and gets_child(work, h, count, 0.0, math.inf):
            _turn(work, h, count, t.reverse_log_prior)
            count += 1
    return count


@njit(nogil=True)
def _speed_of(one: Hypothesis, node: Node) -> float:
    """Return how fast a tag may be: without an accelerometer, slow ranges leave a speed at 0 that only is not known."""
    return float(abs(one.mean[V]) if math.isfinite(node.dv_var) else math.sqrt(one.mean[V] ** 2 + one.cov[V, V]))


@njit(nogil=True)
def follow_rest(work: Hypotheses, count: int, row: Row, node: Node) -> None:
    """Count the time at rest, where no hypothesis has a direction, and the way from the start."""
    row.stood_s = row.stood_s + node.dt_s if node.rest == RESTING else 0.0
    if node.rest != RESTING and row.start.way < DRIVEN:
        row.start.way += _speed_of(work[best_of(work, count)], node) * node.dt_s
    if node.rest == RESTING:
        for h in range(count):
            work[h].reverse = 0
