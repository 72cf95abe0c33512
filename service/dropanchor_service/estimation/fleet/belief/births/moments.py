"""The births of a node, one function per moment of it."""

from dropanchor_service.estimation.fleet.belief.births.carrying import follow_motion, start_carried
from dropanchor_service.estimation.fleet.belief.births.direction import follow_rest, wait_to_turn
from dropanchor_service.estimation.fleet.belief.births.first import collect_start
from dropanchor_service.estimation.fleet.belief.births.forgetting import MODE, RUNS, forget
from dropanchor_service.estimation.fleet.belief.births.loop import bear
from dropanchor_service.estimation.fleet.belief.births.mirrored import start_at_both
from dropanchor_service.estimation.fleet.belief.births.numbers import (
    ALIGNED,
    DEVICE_TURN,
    MOUNT_CELLS,
    OWN_ERROR,
    OWN_ERROR_AGAIN,
    PUSHED_BACK,
    ROTATIONS,
    SIGHT_BACK,
    SIGHT_CLOSED,
    SIGHT_EXPECTED,
    SIGHT_LOST,
    SLOW_AHEAD,
    SPLIT_CURVED,
    SPLIT_WIDE,
    TURN_AFTER_STOP,
)
from dropanchor_service.estimation.fleet.belief.births.rotations import SOURCES
from dropanchor_service.estimation.fleet.belief.births.sight import doubt_nlos, has_jumped, widen_after_misfit
from dropanchor_service.estimation.fleet.belief.births.switches import is_on
from dropanchor_service.estimation.fleet.belief.layout import Anchors, Hypotheses, Row, Scratch
from dropanchor_service.estimation.fleet.belief.mixture import keep_heaviest
from dropanchor_service.estimation.fleet.belief.standing import judge_standstill
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def at_start(work: Hypotheses, row: Row, node: Node, anchors: Anchors, t: Tuning, scratch: Scratch) -> int:
    """Make the first hypotheses once there is enough for them. Return their count."""
    count = collect_start(work, row, node, anchors, t)
    if count > 0:
        count = bear(ALIGNED, OWN_ERROR, work, count, row, node, t, scratch)
        count = bear(MOUNT_CELLS, MOUNT_CELLS, work, count, row, node, t, scratch)
        if node.carried == 1:
            count = start_carried(work, count, row, node, t)
        count = start_at_both(work, count, row, t)
    return count


@njit(nogil=True)
def before_prediction(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> int:
    """Follow what moves the tag, and whether it rests or turns back. Return the count of hypotheses."""
    count = follow_motion(work, count, row, node, t)
    judge_standstill(work, count, row, node, t)
    wait_to_turn(row, node)
    count = bear(SLOW_AHEAD, SLOW_AHEAD, work, count, row, node, t, scratch)
    count = bear(TURN_AFTER_STOP, TURN_AFTER_STOP, work, count, row, node, t, scratch)
    follow_rest(work, count, row, node)
    return count


@njit(nogil=True)
def after_prediction(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> int:
    """Let a device turn, widen a track that is wrong, and expect lines of sight. Return the count of hypotheses."""
    count = bear(DEVICE_TURN, DEVICE_TURN, work, count, row, node, t, scratch)
    row.since_range_s += node.dt_s
    widen_after_misfit(work, count, row, node, t)
    count = bear(SIGHT_EXPECTED, SIGHT_EXPECTED, work, count, row, node, t, scratch)
    doubt_nlos(work, count, node, t)
    return count


@njit(nogil=True)
def place_in_site(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> int:
    """Copy the heaviest hypotheses with all rotations about the anchor. Return the count.

    An ambiguous track is left as it is: each of its modes would need a circle of its own.
    """
    if row.publication.resolved == 0 or not is_on(ROTATIONS, t):
        return count
    count = keep_heaviest(work, count, SOURCES)
    count = bear(ROTATIONS, ROTATIONS, work, count, row, node, t, scratch)
    row.heading.in_site_frame = 1
    forget(row, MODE)
    return count


@njit(nogil=True)
def before_range(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> int:
    """Let a tag turn back that was pushed back. Return the count of hypotheses."""
    return bear(PUSHED_BACK, PUSHED_BACK, work, count, row, node, t, scratch)


@njit(nogil=True)
def after_range(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> int:
    """Lose and find lines of sight where the ranges jump. Return the count of hypotheses."""
    count = bear(SIGHT_LOST, SIGHT_BACK, work, count, row, node, t, scratch)
    if has_jumped(row, t):
        forget(row, RUNS)
    return bear(SIGHT_CLOSED, SIGHT_CLOSED, work, count, row, node, t, scratch)


@njit(nogil=True)
def at_reduction(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> int:
    """Split what a motion makes non-linear. Return the count of hypotheses."""
    return bear(SPLIT_CURVED, SPLIT_WIDE, work, count, row, node, t, scratch)


@njit(nogil=True)
def at_class_check(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> int:
    """Add the heading class that has died out. Return the count of hypotheses."""
    return bear(OWN_ERROR_AGAIN, OWN_ERROR_AGAIN, work, count, row, node, t, scratch)
