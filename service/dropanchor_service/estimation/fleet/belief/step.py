"""Run the pose belief of many rows over a batch of nodes, in one compiled call."""

from dropanchor_service.estimation.fleet.belief.births.carrying import follow_motion, turn_device, was_walked_off
from dropanchor_service.estimation.fleet.belief.births.direction import follow_rest, push_back, turn_back
from dropanchor_service.estimation.fleet.belief.births.first import restart_on_ring
from dropanchor_service.estimation.fleet.belief.births.fix import is_fixed_anew
from dropanchor_service.estimation.fleet.belief.births.forgetting import GAP, NOISE, PLACE, TRACK, forget
from dropanchor_service.estimation.fleet.belief.births.guesses import at_start, try_own_error_again
from dropanchor_service.estimation.fleet.belief.births.rotations import place_in_site, tells_rotation
from dropanchor_service.estimation.fleet.belief.births.sight import (
    contradicts_ranges,
    expect_sight,
    follow_jumps,
    widen_after_misfit,
)
from dropanchor_service.estimation.fleet.belief.births.splitting import split
from dropanchor_service.estimation.fleet.belief.gap import (
    accumulate_gap,
    is_stuck,
    is_suspended,
    is_track_lost,
    publish_suspended,
    restart_from_gap,
)
from dropanchor_service.estimation.fleet.belief.heading_update import update_with_heading
from dropanchor_service.estimation.fleet.belief.layout import (
    CLASSES,
    MAX_HYPOTHESES,
    Anchors,
    Belief,
    Beliefs,
    Hypotheses,
    Pool,
    Row,
    Rows,
    Scratch,
    V,
    Workspace,
)
from dropanchor_service.estimation.fleet.belief.mixture import (
    all_finite,
    best_of,
    keep_heaviest,
    max_hypotheses,
    merge,
    normalise,
    prune,
)
from dropanchor_service.estimation.fleet.belief.pool import load, mirror, release, store
from dropanchor_service.estimation.fleet.belief.predict import fill_class_noise, fill_noise, is_empty, predict
from dropanchor_service.estimation.fleet.belief.publish import publish
from dropanchor_service.estimation.fleet.belief.rigidity import (
    RIGID_SLIP,
    follow_mount,
    follow_sliding,
    slip_std_of,
    weight_power,
)
from dropanchor_service.estimation.fleet.belief.start import is_in_site_frame, uses_heading
from dropanchor_service.estimation.fleet.belief.states import FAULT
from dropanchor_service.estimation.fleet.belief.tilt import bends_tilt
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import BEARING, MOVING, RANGE, RESTING, Node, Nodes
from dropanchor_service.estimation.fleet.measurement.bearing import update_with_bearing
from dropanchor_service.estimation.fleet.measurement.lateral import update_lateral
from dropanchor_service.estimation.fleet.measurement.range import take_height, update_with_range
from dropanchor_service.estimation.fleet.measurement.rest import (
    QUIET_START,
    judge_standstill,
    standing_log_likelihood,
    update_standstill,
)
from dropanchor_service.estimation.fleet.measurement.steps import update_steps
from dropanchor_service.estimation.fleet.tuning import Tuning, TuningRecord

REDUCE_EVERY, CHECK_CLASSES_EVERY = 0.1, 2.0  # s between merging and splitting, between looking at heading classes


@njit(nogil=True)
def _predict_all(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> None:
    """Predict every hypothesis over the node, one heading class after the other: each has noise of its own.

    The accelerometer of a rigid mount then corrects them by the increment of velocity across the course.
    """
    if is_empty(node):
        return
    decay, growth = scratch.decay, scratch.growth
    follow_sliding(work[best_of(work, count)], scratch, node, row, t)
    lateral, slip_std = follow_mount(work, count, row, node, t, scratch), slip_std_of(row)
    rigid = slip_std <= RIGID_SLIP
    power = weight_power(row, rigid, t)
    bends = bends_tilt(node, rigid)
    fill_noise(decay, growth, node, row, t)
    for heading_class in range(CLASSES):
        filled = False
        for h in range(count):
            if work[h].heading_class == heading_class:
                if not filled:
                    fill_class_noise(decay, growth, node, row, heading_class, t)
                    filled = True
                predict(work[h].mean, work[h].cov, scratch, node, row, t, work[h].nlos, bends, rigid)
                if lateral:
                    update_lateral(work[h], scratch, node, row, slip_std, power)


@njit(nogil=True)
def _fuse_motion(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning, scratch: Scratch) -> None:
    """Fuse the node's heading, rest and steps."""
    if is_in_site_frame(node.heading_kind):
        update_with_heading(work, count, row, node, t, scratch)
    if node.rest != MOVING:
        undecided = node.rest == RESTING and row.quiet_share == QUIET_START  # no motion was certain yet
        for h in range(count):
            if undecided:
                work[h].log_weight += standing_log_likelihood(work[h], t)
            work[h].log_weight += update_standstill(work[h].mean, work[h].cov, scratch.PH, node, t)
    if node.carried == 1:
        for h in range(count):
            update_steps(work[h], scratch, node, t)


@njit(nogil=True)
def _fuse_measurement(
    work: Hypotheses, count: int, row: Row, node: Node, anchors: Anchors, t: Tuning, scratch: Scratch, belief: Belief
) -> int:
    """Fuse the node's range or bearing, unless only a frame of the site gives it a meaning. Return the count."""
    if row.heading.in_site_frame == 0 and tells_rotation(row, node):
        count = place_in_site(work, count, row, t)
        if row.heading.in_site_frame == 0:
            return count
    if node.kind == RANGE and row.anchor >= 0 and not belief.stuck:
        count = push_back(work, count, row, node, t)
        update_with_range(work, count, row, node, anchors, t, scratch, belief)
        row.since_range_s = 0.0
        count = follow_jumps(work, count, row, t)
    if node.kind == BEARING and row.anchor >= 0:
        update_with_bearing(work, count, row, node, anchors, t, scratch, belief)
    return count


@njit(nogil=True)
def _reduce_mixture(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Normalise and prune; now and then merge, split and keep both heading classes. Return the count."""
    normalise(work, count)
    count = prune(work, count, t.prune_depth)
    row.since_reduction_s += node.dt_s
    row.since_class_check_s += node.dt_s
    if row.since_reduction_s >= REDUCE_EVERY:
        row.since_reduction_s = 0.0
        if count > 1:
            distance = t.merge_distance if node.rest == MOVING else t.merge_distance_at_rest
            count = merge(work, count, distance, t.merge_light)
        count = split(work, count, row, node, t)
        most = max_hypotheses(row, t)
        if count > most:  # light hypotheses that are dropped make the others too certain: merge what is near first
            count = merge(work, count, t.merge_distance_at_rest, t.merge_light)
        count = keep_heaviest(work, count, most)
    if row.since_class_check_s >= CHECK_CLASSES_EVERY and uses_heading(row, node):
        row.since_class_check_s = 0.0
        count = try_own_error_again(work, count, row, t)
    return count


@njit(nogil=True)
def _run_node(
    work: Hypotheses, count: int, row: Row, node: Node, anchors: Anchors, t: Tuning, scratch: Scratch, belief: Belief
) -> int:
    """Take a node into a row that has hypotheses. Return their count, 0 where the numbers are not finite."""
    count = follow_motion(work, count, row, node, t)
    judge_standstill(work, count, row, node, t)
    count = turn_back(work, count, row, node, t)
    follow_rest(work, count, row, node)
    _predict_all(work, count, row, node, t, scratch)
    _fuse_motion(work, count, row, node, t, scratch)
    count = turn_device(work, count, node, t)
    row.since_range_s += node.dt_s
    widen_after_misfit(work, count, row, node, t)
    count = expect_sight(work, count, row, node, t)
    belief.stuck = is_stuck(row, node, work[best_of(work, count)].mean[V])
    count = _fuse_measurement(work, count, row, node, anchors, t, scratch, belief)
    return _reduce_mixture(work, count, row, node, t) if all_finite(work, count) else 0


@njit(nogil=True)
def _reset_after_fault(row: Row, pool: Pool, lane: int) -> None:
    """Start a row again whose numbers were not finite. It is no longer where it started."""
    row.faults += 1
    row.publication.reason = FAULT
    release(row, pool, lane)
    forget(row, PLACE | GAP | TRACK | NOISE)


@njit(nogil=True)
def _start(work: Hypotheses, row: Row, node: Node, anchors: Anchors, t: Tuning) -> int:
    """Take a node into a row without hypotheses, and make the first ones where it has enough. Return their count."""
    if is_suspended(row, node):
        return 0
    if row.gap.unobserved_s > 0.0:
        restart_from_gap(row, anchors[row.anchor], t)
    return at_start(work, row, node, anchors, t)


@njit(nogil=True)
def _advance_row(
    space: Workspace, count: int, row: Row, pool: Pool, node: Node, anchors: Anchors, t: Tuning, belief: Belief
) -> int:
    """Take one node into the row. Return the count of hypotheses, which start again where they are wrong."""
    work, scratch = space.hypotheses, space.scratch
    if count > 0:
        accumulate_gap(work, count, row, node)
    if count > 0 and (
        is_track_lost(row, node)
        or was_walked_off(row, node, t)
        or is_fixed_anew(work[best_of(work, count)], row, node, anchors)
    ):
        release(row, pool, scratch.lane)
        forget(row, TRACK)
        count = 0
    if count == 0:
        return _start(work, row, node, anchors, t)
    count = _run_node(work, count, row, node, anchors, t, scratch, belief)
    if count == 0:
        _reset_after_fault(row, pool, scratch.lane)
    elif node.kind == RANGE and node.anchor == row.anchor and contradicts_ranges(work, count, row, t):
        return restart_on_ring(work, count, row, node, anchors[row.anchor], t)
    return count


@njit(nogil=True, cache=True)
def advance(
    rows: Rows, pool: Pool, nodes: Nodes, anchors: Anchors, tuning: TuningRecord, workspace: Rows, beliefs: Beliefs
) -> int:
    """Run the nodes and write one belief per node. The nodes of one row are in order of time.

    Return how many nodes are left because the lane of the workspace has no room for another row.
    """
    work, scratch, t = workspace[0].hypotheses, workspace[0].scratch, tuning[0]
    current = -1
    count = 0
    for k in range(len(nodes)):
        node = nodes[k]
        if node.row != current:
            if current >= 0:
                store(rows[current], pool, work, count, scratch.lane)
            current = node.row
            if pool[scratch.lane].free + rows[current].count < MAX_HYPOTHESES:
                return len(nodes) - k
            load(rows[current], pool, work)
            count = rows[current].count
        row = rows[current]
        row.t_ns = node.t_ns
        belief = beliefs[k]
        take_height(row, node, belief)
        count = _advance_row(workspace[0], count, row, pool, node, anchors, t, belief)
        for h in range(count):
            mirror(work[h].cov)
        if count > 0:
            publish(work, count, row, node, anchors, t, belief, scratch)
        elif row.gap.unobserved_s > 0.0:
            publish_suspended(row, node, anchors, belief)
        belief.state, belief.reason = row.publication.state, row.publication.reason
    if current >= 0:
        store(rows[current], pool, work, count, scratch.lane)
    return 0
