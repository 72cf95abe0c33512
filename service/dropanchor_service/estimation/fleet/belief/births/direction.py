"""In which direction a tag drives along its course: one that stops or is pushed back may turn back.

At rest there is no direction. Only an accelerometer tells the two apart soon enough. One that is merely slow turns back
in no hypothesis: past the anchor that would be a mirror image, which ranges and a bias of the accelerometer explain.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.births.numbers import (
    PUSHED_BACK,
    SLOW_AHEAD,
    TURN_AFTER_STOP,
)
from dropanchor_service.estimation.fleet.belief.layout import Hypotheses, Hypothesis, Row, V
from dropanchor_service.estimation.fleet.belief.mixture import best_of, copy_hypothesis
from dropanchor_service.estimation.fleet.belief.rigidity import is_mount_untold
from dropanchor_service.estimation.fleet.belief.standing import SLOW
from dropanchor_service.estimation.fleet.belief.start import starts_at_place
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import RESTING, Node
from dropanchor_service.estimation.fleet.tuning import Tuning

STOOD_S: Final = 0.1  # s of rest after which a tag may drive off in the other direction
SLOW_EVERY: Final = 0.5  # s
EVEN: Final = -0.7  # log of one half
REFUSED: Final = 2.0  # standard deviations of speed in the other direction that are not noise
DRIVEN: Final = 0.5  # m from the start after which a tag has a direction to turn back from
TURNABOUT_DEPTH: Final = 8.0  # log weight below the best at which a hypothesis is not offered the other direction


@njit(nogil=True)
def is_due(kind: int, row: Row, node: Node) -> bool:
    """Return whether row and node ask for a turn."""
    if kind == PUSHED_BACK:
        return can_turn(node)
    return turns_after_stop(row, node) if kind == TURN_AFTER_STOP else is_slow(row, node)


@njit(nogil=True)
def admits(kind: int, one: Hypothesis, row: Row, t: Tuning) -> bool:
    """Return whether a hypothesis may turn back."""
    if one.aligned == 0 and is_either_way(row, t):
        return False
    if kind == SLOW_AHEAD:
        return may_drive_ahead(one)
    return kind == TURN_AFTER_STOP or is_pushed_back(one, t)


@njit(nogil=True)
def make(kind: int, work: Hypotheses, source: int, target: int, row: Row) -> None:
    """Copy `source` for the other direction. One that slowed down waits before it may turn back again."""
    copy_hypothesis(work, source, target)
    work[target].reverse = 1 - work[source].reverse
    if kind == SLOW_AHEAD:
        row.since_turnabout_s = 0.0
        work[source].log_weight += EVEN


@njit(nogil=True)
def is_either_way(row: Row, t: Tuning) -> bool:
    """Return whether a tag has not driven yet since a start with mounting angles all around.

    There, one that drives off backwards is the one that is mounted the other way round.
    """
    return bool(starts_at_place(row) and row.settings.mount_angle_std > t.mount_cell and row.start.way < DRIVEN)


@njit(nogil=True)
def can_turn(node: Node) -> bool:
    """Return whether the node's accelerations tell how a vehicle drives."""
    return bool(node.carried == 0 and math.isfinite(node.dv_var))


@njit(nogil=True)
def is_slow(row: Row, node: Node) -> bool:
    """Return whether tags that have slowed down may turn back now, whether they stand or not."""
    return bool(can_turn(node) and node.rest != RESTING and row.since_turnabout_s >= SLOW_EVERY)


@njit(nogil=True)
def turns_after_stop(row: Row, node: Node) -> bool:
    """Return whether the tag drives off after a stop."""
    return bool(can_turn(node) and node.rest != RESTING and row.stood_s >= STOOD_S)


@njit(nogil=True)
def may_drive_ahead(one: Hypothesis) -> bool:
    """Return whether a hypothesis that reverses has slowed down."""
    return bool(one.reverse == 1 and one.mean[V] > -SLOW / 2)


@njit(nogil=True)
def may_reverse(row: Row, t: Tuning) -> bool:
    """Return whether a tag moves backwards as easily as ahead: it is told to, or it may be mounted backwards."""
    return bool(row.settings.reverse_allowed == 1 or is_mount_untold(row, t))


@njit(nogil=True)
def is_pushed_back(one: Hypothesis, t: Tuning) -> bool:
    """Return whether the accelerometer says that a tag turned back though no rest was seen: some stops are too short.

    Ask before the speed is truncated to the direction of the hypothesis.
    """
    ahead = one.mean[V] if one.reverse == 0 else -one.mean[V]
    return bool(ahead + t.reverse_slack < -REFUSED * math.sqrt(one.cov[V, V]))


@njit(nogil=True)
def turnabout_log_prior(row: Row, t: Tuning) -> float:
    """Return the log prior of driving off in the other direction."""
    return 0.0 if may_reverse(row, t) else t.reverse_log_prior


@njit(nogil=True)
def wait_to_turn(row: Row, node: Node) -> None:
    """Count the time since a tag that slowed down was last offered to turn back."""
    if can_turn(node) and node.rest != RESTING:
        row.since_turnabout_s += node.dt_s


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
