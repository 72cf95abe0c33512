"""The births at the start of a track, and those about its prediction."""

import math

from dropanchor_service.estimation.fleet.belief.births.carrying import follow_motion, start_carried, turn_device
from dropanchor_service.estimation.fleet.belief.births.direction import follow_rest, turn_back
from dropanchor_service.estimation.fleet.belief.births.first import collect_start
from dropanchor_service.estimation.fleet.belief.births.heading_classes import copy_own_error, may_have_own_error
from dropanchor_service.estimation.fleet.belief.births.mirrored import start_at_both
from dropanchor_service.estimation.fleet.belief.births.mounting import (
    add_mounts,
    copy_aligned,
    may_be_aligned,
    may_be_mounted_anyhow,
)
from dropanchor_service.estimation.fleet.belief.births.sight import expect_sight, widen_after_misfit
from dropanchor_service.estimation.fleet.belief.layout import MAX_HYPOTHESES, Anchors, Hypotheses, Row
from dropanchor_service.estimation.fleet.belief.standing import judge_standstill
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def at_start(work: Hypotheses, row: Row, node: Node, anchors: Anchors, t: Tuning) -> int:
    """Make the first hypotheses once there is enough for them. Return their count."""
    count = collect_start(work, row, node, anchors, t)
    if count > 0:
        aligned, own_error = may_be_aligned(row, node, t), may_have_own_error(row, node, t)
        for h in range(count):
            if aligned and count < MAX_HYPOTHESES:
                copy_aligned(work, h, count, t)
                count += 1
            if own_error and count < MAX_HYPOTHESES:
                copy_own_error(work, h, count, row, t, not math.isfinite(row.start.heading))
                count += 1
        if may_be_mounted_anyhow(row, node, t):
            count = add_mounts(work, count, row, t)
        if node.carried == 1:
            count = start_carried(work, count, row, node, t)
        count = start_at_both(work, count, row, t)
    return count


@njit(nogil=True)
def before_prediction(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Follow what moves the tag, and whether it rests or turns back. Return the count of hypotheses."""
    count = follow_motion(work, count, row, node, t)
    judge_standstill(work, count, row, node, t)
    count = turn_back(work, count, row, node, t)
    follow_rest(work, count, row, node)
    return count


@njit(nogil=True)
def after_prediction(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Let a device turn, widen a track that is wrong, and expect lines of sight. Return the count of hypotheses."""
    count = turn_device(work, count, node, t)
    row.since_range_s += node.dt_s
    widen_after_misfit(work, count, row, node, t)
    return expect_sight(work, count, row, node, t)
