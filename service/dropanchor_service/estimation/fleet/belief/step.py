"""Run the pose belief of many rows over a batch of nodes, in one compiled call."""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.carried import (
    follow_motion,
    start_carried,
    update_with_steps,
    was_walked_off,
)
from dropanchor_service.estimation.fleet.belief.gap import (
    accumulate_gap,
    is_stuck,
    is_suspended,
    is_track_lost,
    publish_suspended,
    restart_from_gap,
)
from dropanchor_service.estimation.fleet.belief.heading_classes import keep_both_classes
from dropanchor_service.estimation.fleet.belief.lateral import is_lateral_known, update_lateral
from dropanchor_service.estimation.fleet.belief.layout import (
    CLASSES,
    MAX_HYPOTHESES,
    Anchors,
    Belief,
    Beliefs,
    Floats,
    Hypotheses,
    Pool,
    Row,
    Rows,
    Scratch,
    V,
)
from dropanchor_service.estimation.fleet.belief.measurements import (
    update_with_bearing,
    update_with_heading,
    update_with_range,
)
from dropanchor_service.estimation.fleet.belief.mixture import (
    all_finite,
    best_of,
    keep_heaviest,
    max_hypotheses,
    may_split_curved,
    merge,
    normalise,
    prune,
    split,
)
from dropanchor_service.estimation.fleet.belief.nlos import (
    close_nlos,
    contradicts_ranges,
    expect_los,
    propose_alternatives,
    widen_after_misfit,
)
from dropanchor_service.estimation.fleet.belief.placing import place_in_site, tells_rotation
from dropanchor_service.estimation.fleet.belief.pool import load, mirror, release, store
from dropanchor_service.estimation.fleet.belief.predict import (
    add_process_noise,
    fill_class_noise,
    fill_noise,
    predict_covariance,
    predict_state,
)
from dropanchor_service.estimation.fleet.belief.publish import publish
from dropanchor_service.estimation.fleet.belief.rigidity import RIGID_SLIP, follow_mount, slip_std_of, weight_power
from dropanchor_service.estimation.fleet.belief.standing import judge_standstill, offer_refused, offer_turnabout
from dropanchor_service.estimation.fleet.belief.start import (
    collect_start,
    is_in_site_frame,
    restart_on_ring,
    uses_heading,
)
from dropanchor_service.estimation.fleet.belief.states import FAULT, INITIALISING
from dropanchor_service.estimation.fleet.belief.tilt import bends_tilt, follow_tilt
from dropanchor_service.estimation.fleet.belief.update import update_standstill
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import BEARING, MOVING, RANGE, Node, Nodes
from dropanchor_service.estimation.fleet.tuning import Tuning, TuningRecord

REDUCE_EVERY, CHECK_CLASSES_EVERY = 0.1, 2.0  # s between merging and splitting, between looking at heading classes
SPLIT_DEPTH: Final = 6.0  # log weight below the best at which a hypothesis is not split


@njit(nogil=True)
def _is_empty(node: Node) -> bool:
    """Return whether no time passed since the node before: a range came with the IMU sample that ended it."""
    return bool(node.dt_s == 0.0 and node.dyaw == 0.0 and node.dyaw_var == 0.0 and node.dv_forward == 0.0)


@njit(nogil=True)
def _predict_all(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> None:
    """Predict every hypothesis over the node, one heading class after the other: each has noise of its own.

    The accelerometer of a rigid mount then corrects them by the increment of velocity across the course.
    """
    if _is_empty(node):
        return
    decay, growth, F, FP = scratch.decay, scratch.growth, scratch.F, scratch.FP
    lateral, slip_std = follow_mount(work, count, row, node, t, scratch), slip_std_of(row)
    rigid = slip_std <= RIGID_SLIP
    power = weight_power(row, rigid, t)
    bends = bends_tilt(node) and (rigid or is_lateral_known(node))
    fill_noise(decay, growth, node, row, t)
    for heading_class in range(CLASSES):
        filled = False
        for h in range(count):
            if work[h].heading_class == heading_class:
                if not filled:
                    fill_class_noise(decay, growth, node, row, heading_class, t)
                    filled = True
                predict_state(work[h].mean, node, decay, F)
                predict_covariance(work[h].cov, F, decay, FP)
                add_process_noise(work[h].mean, work[h].cov, F, growth, node, row, t, work[h].nlos)
                if bends:
                    follow_tilt(work[h].mean, work[h].cov, node, rigid, t)
                if lateral:
                    update_lateral(work[h], scratch, node, row, slip_std, power)


@njit(nogil=True)
def _reduce_mixture(work: Hypotheses, count: int, row: Row, node: Node, PH: Floats, t: Tuning) -> int:
    """Normalise and prune; now and then merge, split and keep both heading classes. Return the count."""
    normalise(work, count)
    count = prune(work, count, t.prune_depth)
    row.since_reduction_s += node.dt_s
    row.since_class_check_s += node.dt_s
    if row.since_reduction_s >= REDUCE_EVERY:
        row.since_reduction_s = 0.0
        moving = node.rest == MOVING
        if count > 1:
            count = merge(work, count, t.merge_distance if moving else t.merge_distance_at_rest, t.merge_light)
        if moving:  # only a motion makes a wide angle non-linear
            angle = t.coarse_split_angle if row.start.coarse == 1 else t.split_angle
            if row.walk.carried == 1:
                angle = t.walk_split_angle
            curved = t.split_curvature if may_split_curved(work, count, row) else math.inf
            count = split(work, count, angle, curved, SPLIT_DEPTH)
        count = keep_heaviest(work, count, max_hypotheses(row, t))
    if row.since_class_check_s >= CHECK_CLASSES_EVERY and uses_heading(row, node):
        row.since_class_check_s = 0.0
        count = keep_both_classes(work, count, row, node, PH, t)
    return count


@njit(nogil=True)
def _follow_motion_of(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> int:
    """Predict all hypotheses over the node, and fuse its heading, rest and steps. Return their count."""
    count = follow_motion(work, count, row, node, t)
    judge_standstill(work, count, row, node, t)
    count = offer_turnabout(work, count, row, node, t)
    _predict_all(work, count, row, node, t, scratch)
    if is_in_site_frame(node.heading_kind):
        count = update_with_heading(work, count, row, node, t, scratch)
    if node.rest != MOVING:
        for h in range(count):
            work[h].log_weight += update_standstill(work[h].mean, work[h].cov, scratch.PH, node, t)
    if node.carried == 1:
        count = update_with_steps(work, count, node, t, scratch)
    return count


@njit(nogil=True)
def _fuse_measurement(
    work: Hypotheses, count: int, row: Row, node: Node, anchors: Anchors, t: Tuning, scratch: Scratch, belief: Belief
) -> int:
    """Fuse the node's range or bearing, unless only a frame of the site gives it a meaning. Return the count."""
    if row.heading.in_site_frame == 0 and tells_rotation(row, node):
        count = place_in_site(work, count, row)
        if row.heading.in_site_frame == 0:
            return count
    if node.kind == RANGE and row.anchor >= 0 and not belief.stuck:
        count = offer_refused(work, count, node, t)
        update_with_range(work, count, row, node, anchors, t, scratch, belief)
        row.since_range_s = 0.0
        count = propose_alternatives(work, count, row, t)
        close_nlos(work, count, scratch.PH, t)
    if node.kind == BEARING and row.anchor >= 0:
        update_with_bearing(work, count, row, node, anchors, t, scratch, belief)
    return count


@njit(nogil=True)
def _run_node(
    work: Hypotheses, count: int, row: Row, node: Node, anchors: Anchors, t: Tuning, scratch: Scratch, belief: Belief
) -> int:
    """Predict and update a row that has hypotheses. Return their count, 0 where the numbers are not finite."""
    count = _follow_motion_of(work, count, row, node, t, scratch)
    row.since_range_s += node.dt_s
    widen_after_misfit(work, count, row, node, t)
    count = expect_los(work, count, row, node.dt_s, t)
    belief.stuck = is_stuck(row, node, work[best_of(work, count)].mean[V])
    count = _fuse_measurement(work, count, row, node, anchors, t, scratch, belief)
    if not all_finite(work, count):
        return 0
    count = _reduce_mixture(work, count, row, node, scratch.PH, t)
    for h in range(count):
        mirror(work[h].cov)
    return count


@njit(nogil=True)
def _reset_row(row: Row, pool: Pool) -> None:
    """Forget all hypotheses, so that the row starts again."""
    release(row, pool)
    row.start.range_count = 0
    row.start.collected_s = 0.0
    row.heading.bank_started = row.heading.model = row.heading.in_site_frame = 0
    row.heading.slow_var = 0.0
    row.publication.resolved = 0
    row.publication.state = INITIALISING
    row.publication.information[:] = 0.0
    row.publication.resolved_s = 0.0
    row.nlos.misfit = row.nlos.misfit_s = 0.0
    row.nlos.widened = 0
    row.walk.carried = 0
    row.walk.var = 0.0


@njit(nogil=True)
def _reset_after_fault(row: Row, pool: Pool) -> None:
    """Start a row again whose numbers were not finite. It is no longer where it started."""
    row.faults += 1
    row.publication.reason = FAULT
    row.start.known = row.start.after_gap = 0
    row.gap.unobserved_s = 0.0
    _reset_row(row, pool)


@njit(nogil=True)
def _advance_row(
    work: Hypotheses,
    count: int,
    row: Row,
    pool: Pool,
    node: Node,
    anchors: Anchors,
    t: Tuning,
    scratch: Scratch,
    belief: Belief,
) -> int:
    """Take one node into the row, which starts or starts again where it must. Return the count of hypotheses."""
    if count > 0:
        accumulate_gap(work, count, row, node)
        if not is_track_lost(row, node) and not was_walked_off(row, node):
            count = _run_node(work, count, row, node, anchors, t, scratch, belief)
            if count == 0:
                _reset_after_fault(row, pool)
            elif node.kind == RANGE and node.anchor == row.anchor and contradicts_ranges(work, count, row, t):
                count = restart_on_ring(work, count, row, node, anchors[row.anchor], t)
            return count
        _reset_row(row, pool)
    if is_suspended(row, node):
        return 0
    if row.gap.unobserved_s > 0.0:
        restart_from_gap(row, anchors[row.anchor])
    count = collect_start(work, row, node, anchors, t)
    if count > 0 and node.carried == 1:
        count = start_carried(work, count, row, node, t)
    for h in range(count):
        mirror(work[h].cov)
    return count


@njit(nogil=True, cache=True)
def advance(
    rows: Rows, pool: Pool, nodes: Nodes, anchors: Anchors, tuning: TuningRecord, workspace: Rows, beliefs: Beliefs
) -> int:
    """Run the nodes and write one belief per node. The nodes of one row are in order of time.

    Return how many nodes are left because the pool has no room for another row.
    """
    work, scratch, t = workspace[0].hypotheses, workspace[0].scratch, tuning[0]
    current = -1
    count = 0
    for k in range(len(nodes)):
        node = nodes[k]
        if node.row != current:
            if current >= 0:
                store(rows[current], pool, work, count)
            current = node.row
            if pool[0].free + rows[current].count < MAX_HYPOTHESES:
                return len(nodes) - k
            load(rows[current], pool, work)
            count = rows[current].count
        row = rows[current]
        row.t_ns = node.t_ns
        belief = beliefs[k]
        count = _advance_row(work, count, row, pool, node, anchors, t, scratch, belief)
        if count > 0:
            publish(work, count, row, node, anchors, t, belief, scratch)
        elif row.gap.unobserved_s > 0.0:
            publish_suspended(row, node, anchors, belief)
        belief.state, belief.reason = row.publication.state, row.publication.reason
    if current >= 0:
        store(rows[current], pool, work, count)
    return 0
