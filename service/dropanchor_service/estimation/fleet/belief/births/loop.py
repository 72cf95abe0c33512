"""The loop that runs the births of one moment: one capacity check, one rule for what is too light.

A birth is due by what its row and node say, and admits single hypotheses. Each one that it admits, and that is not too
light for it, gets children while there is room. A change in kind is a birth without children.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.births import direction, heading_classes, mounting, sight, splitting
from dropanchor_service.estimation.fleet.belief.births.carrying import BRANCH_DEPTH, copy_turned_device
from dropanchor_service.estimation.fleet.belief.births.numbers import (
    ALIGNED,
    DEVICE_TURN,
    MOUNT_CELLS,
    OF_DIRECTION,
    OF_HEADING,
    OF_MOUNTING,
    OF_SIGHT,
    OF_SPLITTING,
    OWN_ERROR,
    OWN_ERROR_AGAIN,
    ROTATIONS,
    SIGHT_CLOSED,
    SLOW_AHEAD,
    TURN_AFTER_STOP,
)
from dropanchor_service.estimation.fleet.belief.births.rotations import OTHER_ROTATIONS, add_rotations
from dropanchor_service.estimation.fleet.belief.births.switches import is_on
from dropanchor_service.estimation.fleet.belief.layout import (
    MAX_HYPOTHESES,
    WORKING_HYPOTHESES,
    Hypotheses,
    Hypothesis,
    Row,
    Scratch,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning

ANY_DEPTH: Final = math.inf  # however light
HEAVIEST: Final = 0.0  # the heaviest hypothesis alone
LIGHT: Final = 6.0  # log weight below the best at which a hypothesis is not split, and its line of sight not doubted


@njit(nogil=True, borrows=True)
def is_due(kind: int, work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> bool:
    """Return whether row and node ask for a birth. Some are due again after a period, which this begins anew."""
    if kind in OF_DIRECTION:
        return direction.is_due(kind, row, node)
    if kind in OF_SIGHT:
        return sight.is_due(kind, row, node, t)
    if kind in OF_SPLITTING:
        return splitting.is_due(kind, work, count, row, node)
    if kind in OF_HEADING:
        return heading_classes.is_due(kind, work, count, row, node)
    if kind in OF_MOUNTING:
        return mounting.is_due(kind, row, node, t)
    return bool(kind != DEVICE_TURN or (node.carried == 1 and node.turned != 0.0))


@njit(nogil=True)
def admits(kind: int, one: Hypothesis, row: Row, t: Tuning) -> bool:
    """Return whether a birth that is due is one of this hypothesis."""
    if kind in OF_DIRECTION:
        return direction.admits(kind, one, row, t)
    if kind in OF_SIGHT:
        return sight.admits(kind, one, row, t)
    if kind in OF_SPLITTING:
        return splitting.admits(kind, one, row, t)
    if kind in OF_MOUNTING:
        return mounting.admits(kind, one)
    return True


@njit(nogil=True)
def depth_of(kind: int) -> float:
    """Return the log weight below the best at which a hypothesis is too light for a birth."""
    if kind == TURN_AFTER_STOP:
        return direction.TURNABOUT_DEPTH
    if kind == DEVICE_TURN:
        return BRANCH_DEPTH
    if kind in OF_SPLITTING or (kind in OF_SIGHT and kind != SIGHT_CLOSED):
        return LIGHT
    if kind == OWN_ERROR_AGAIN:
        return HEAVIEST
    return ANY_DEPTH


@njit(nogil=True)
def children_of(kind: int, t: Tuning) -> int:
    """Return how many children each hypothesis gets that a birth admits."""
    if kind == SIGHT_CLOSED:
        return 0
    if kind == MOUNT_CELLS:
        return mounting.other_cells(t)
    if kind == ROTATIONS:
        return OTHER_ROTATIONS
    return 2 if kind in OF_SPLITTING else 1


@njit(nogil=True)
def has_room(kind: int, count: int, t: Tuning) -> bool:
    """Return whether the children of one more hypothesis fit. A mixture is reduced after it was split."""
    return count + children_of(kind, t) <= (WORKING_HYPOTHESES if kind in OF_SPLITTING else MAX_HYPOTHESES)


@njit(nogil=True)
def log_prior_of(kind: int, row: Row, t: Tuning) -> float:
    """Return the log prior of an only child."""
    if kind in OF_SIGHT:
        return t.nlos_log_prior
    if kind == SLOW_AHEAD:
        return direction.EVEN
    if kind in OF_DIRECTION:
        return direction.turnabout_log_prior(row, t) if kind == TURN_AFTER_STOP else t.reverse_log_prior
    if kind == DEVICE_TURN:
        return t.device_turn_log_prior
    if kind == ALIGNED:
        return t.aligned_log_prior
    if kind == OWN_ERROR:
        return heading_classes.own_error_log_prior(row, t)
    if kind == OWN_ERROR_AGAIN:
        return t.own_error_again_log_prior
    return 0.0


@njit(nogil=True)
def make(kind: int, work: Hypotheses, h: int, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> None:
    """Put the children of hypothesis h at `count`, or change h itself."""
    if kind in OF_DIRECTION:
        direction.make(kind, work, h, count, row)
    elif kind in OF_SIGHT:
        sight.make(kind, work, h, count, t, scratch)
    elif kind in OF_SPLITTING:
        splitting.add_parts(work, h, count)
    elif kind in OF_HEADING:
        heading_classes.make(kind, work, h, count, row, t)
    elif kind in OF_MOUNTING:
        mounting.make(kind, work, h, count, row, t)
    elif kind == ROTATIONS:
        add_rotations(work, h, count)
    else:
        copy_turned_device(work, h, count, node.turned, t)


@njit(nogil=True, borrows=True)
def _due(first: int, last: int, work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Return a bit for each birth that is switched on and due."""
    due = 0
    for kind in range(first, last + 1):
        if is_on(kind, t) and is_due(kind, work, count, row, node, t):
            due |= 1 << kind
    return due


@njit(nogil=True, borrows=True)
def bear(first: int, last: int, work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> int:
    """Run the births `first` to `last`, which are of one moment. Return the count of hypotheses.

    Each hypothesis has all of its children before the next one has any. Children get none at the same moment.
    """
    due = _due(first, last, work, count, row, node, t)
    if due == 0:
        return count
    best = best_of(work, count)
    top = work[best].log_weight
    for h in range(count):
        for kind in range(first, last + 1):
            admitted = (due >> kind) & 1 == 1 and admits(kind, work[h], row, t) and has_room(kind, count, t)
            if admitted and (h == best or work[h].log_weight > top - depth_of(kind)):
                make(kind, work, h, count, row, node, t, scratch)
                children = children_of(kind, t)
                if children == 1:
                    work[count].log_weight += log_prior_of(kind, row, t)
                count += children
    return count
