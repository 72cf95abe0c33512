"""The pose belief of many rows over a batch of nodes, in one compiled call."""

import math
from typing import Any

from dropanchor_service.estimation.fleet.belief import layout
from dropanchor_service.estimation.fleet.belief.gap import (
    hold_place,
    is_held,
    loses_track,
    place_again,
    repeats,
    watch_gap,
)
from dropanchor_service.estimation.fleet.belief.heading_models import (
    error_of_class,
    judge_models,
    model_of,
    predict_models,
    reset_models,
    told_of,
)
from dropanchor_service.estimation.fleet.belief.heading_reference import give_reference_error, recount_yaw, turn_about
from dropanchor_service.estimation.fleet.belief.layout import COMMON, CRAB, DRIFTING, PHI, STEADY, YAW, R, V
from dropanchor_service.estimation.fleet.belief.mixture import best_of, finite, limit, merge, normalise, prune, split
from dropanchor_service.estimation.fleet.belief.nlos import expect_clear, open_alternative, recover, unblock
from dropanchor_service.estimation.fleet.belief.pool import load, mirror, release, store
from dropanchor_service.estimation.fleet.belief.predict import diffuse, fill_class, fill_decay, move, transport
from dropanchor_service.estimation.fleet.belief.publish import publish
from dropanchor_service.estimation.fleet.belief.start import begin, blame_gyro, counts_from, is_referred, reseed
from dropanchor_service.estimation.fleet.belief.update import (
    bound_speed,
    predict_range,
    update_bearing,
    update_heading,
    update_range,
    update_rest,
    wrap,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import ABSOLUTE_HEADING, BEARING, MEASURED_HEADING, RANGE
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def _is_instant(node: Any) -> bool:
    """Nothing passed since the node before: a range fell on the IMU sample that had ended one."""
    return bool(node.dt_s == 0.0 and node.dyaw == 0.0 and node.dyaw_var == 0.0 and node.dv_forward == 0.0)


@njit(nogil=True)
def _predict_all(work: Any, count: int, row: Any, node: Any, t: Tuning, scratch: Any) -> None:
    if _is_instant(node):
        return
    decay, growth, F, FP = scratch.decay, scratch.growth, scratch.F, scratch.FP
    fill_decay(decay, growth, node, row, t)
    for kind in range(3):
        filled = False
        for h in range(count):
            if work[h].kind == kind:
                if not filled:
                    fill_class(decay, growth, node, row, kind, t)
                    filled = True
                move(work[h].mean, node, decay, F)
                transport(work[h].cov, F, decay, FP)
                diffuse(work[h].mean, work[h].cov, F, growth, node, t, work[h].blocked)


@njit(nogil=True)
def _range_all(work: Any, count: int, row: Any, node: Any, anchors: Any, t: Tuning, scratch: Any, belief: Any) -> None:
    """Update every hypothesis; the belief gets what the best one saw."""
    H, PH, out = scratch.H, scratch.PH, scratch.out
    anchor, primary = anchors[node.anchor], anchors[row.anchor]
    ox, oy = anchor.x - primary.x, anchor.y - primary.y
    dz = row.height - anchor.z
    z = node.z / row.range_scale
    std = node.z_std if math.isfinite(node.z_std) and node.z_std > 0.0 else row.range_std
    best = best_of(work, count)
    y, S, p_outlier = 0.0, 1.0, 0.0
    low = -row.v_max if row.reverse == 1 else -t.reverse_slack
    for h in range(count):
        s, P = work[h].mean, work[h].cov
        e = z - predict_range(s, ox, oy, dz, node.lag_s, H)
        variance = std * std + (dz * row.height_std / max(z, 0.1)) ** 2
        if node.anchor != row.anchor:
            variance += row.offset_std**2
        if math.isfinite(node.dv_var):
            variance += t.bilinear * P[V, V] * P[CRAB, CRAB] * row.crab_tau**2
        update_range(work[h], scratch, e, variance, t)
        work[h].log_weight += t.temper * out[0]
        if s[R] < 0.0:
            s[R] = 1e-3
        work[h].log_weight += bound_speed(s, P, PH, low, row.v_max)
        if h == best:
            y, S, p_outlier = e, out[1], out[2]
    _judge_fit(row, y, S, p_outlier)
    _tell(belief, y, S, p_outlier)


@njit(nogil=True)
def _tell(belief: Any, y: float, S: float, p_outlier: float) -> None:
    belief.innovation = y
    belief.innovation_variance = S
    belief.p_outlier = p_outlier


@njit(nogil=True)
def _judge_fit(row: Any, y: float, S: float, p_outlier: float) -> None:
    """How long innovations have stayed on one side, and how much of them are outliers."""
    row.high_run = row.high_run + 1 if y > 1.5 * math.sqrt(S) else 0
    row.low_run = row.low_run + 1 if y < -1.5 * math.sqrt(S) else 0
    row.misfit += 0.1 * (p_outlier - row.misfit)


@njit(nogil=True)
def _judge_reference(work: Any, count: int, row: Any, node: Any, t: Tuning) -> int:
    """Let the readings say how their error behaves; a new model gives every hypothesis its slow error.

    Returns the count of hypotheses.
    """
    if row.hm_started == 0:
        reset_models(row, node.heading, node.heading_var, t)
        return count
    predict_models(row, node, node.heading_var, t)
    chosen = judge_models(row, node, t)
    if chosen == row.model:
        return count
    _, before, _ = model_of(row.model, node.heading_var)
    _, after, _ = model_of(chosen, node.heading_var)
    row.model = chosen
    count = blame_gyro(work, count, chosen, after, t)
    if after > before:
        for h in range(count):
            if work[h].kind != DRIFTING:
                give_reference_error(work[h].cov, math.sqrt(after * after - before * before), False)
    return count


@njit(nogil=True)
def _refer(work: Any, count: int, row: Any, node: Any) -> bool:
    """The first heading from a reference: turn a belief of arbitrary zero, or count yaw from the reference.

    With a given start nobody knows the reference's own zero, so it is taken to agree with the yaw of now, and the error
    of that yaw, which stays from now on, becomes one of the mounting angle. That is done when the reference has become
    better than the yaw. Returns whether it was done.
    """
    best = work[best_of(work, count)]
    if row.referred == 1 and node.heading_var > best.cov[YAW, YAW]:
        return False
    row.model = COMMON
    std = math.sqrt(node.heading_var)
    delta = wrap(node.heading - best.mean[YAW])
    for h in range(count):
        if row.referred == 0:
            work[h].mean[YAW] += delta
            work[h].mean[PHI] += delta
            turn_about(work[h].cov, std)
        else:
            recount_yaw(work[h].cov, node.heading_var)
    row.north = delta if row.referred == 1 else 0.0
    row.referred = 1
    return True


@njit(nogil=True)
def _heading_all(work: Any, count: int, row: Any, node: Any, t: Tuning, scratch: Any) -> int:
    """Returns the count of hypotheses."""
    if node.heading_kind == MEASURED_HEADING:
        if not told_of(row):
            count = _judge_reference(work, count, row, node, t)
    elif node.heading_kind == ABSOLUTE_HEADING and row.model != COMMON and not _refer(work, count, row, node):
        return count
    for h in range(count):
        if row.model != STEADY or work[h].kind == 0:
            white, _, _ = error_of_class(row, work[h].kind, node.heading_var, t)
            update_heading(work[h], scratch, node.heading - row.north, white)
    return count


@njit(nogil=True)
def _most(row: Any, t: Tuning) -> int:
    """Hypotheses that the row may have."""
    if row.declared == 1:
        return t.keep_tracking
    return t.keep_coarse if row.coarse == 1 else layout.KEEP


@njit(nogil=True)
def _manage(work: Any, count: int, row: Any, node: Any, PH: Any, t: Tuning) -> int:
    """Normalise, prune, now and then merge, split and re-seed the second class; returns the count."""
    normalise(work, count)
    count = prune(work, count, t.prune)
    row.since_manage_s += node.dt_s
    row.since_seed_s += node.dt_s
    if row.since_manage_s >= 0.1:
        row.since_manage_s = 0.0
        if count > 1:
            count = merge(work, count, t.merge_distance if node.rest == 0 else t.merge_at_rest, t.merge_light)
        if node.rest == 0:  # only what moves bends
            count = split(work, count, t.split_coarse if row.coarse == 1 else t.split_angle, 6.0)
        count = limit(work, count, _most(row, t))
    if row.since_seed_s >= 2.0 and counts_from(row, node):
        row.since_seed_s = 0.0
        count = reseed(work, count, row, node, PH, t)
    return count


@njit(nogil=True)
def _step(work: Any, count: int, row: Any, node: Any, anchors: Any, t: Tuning, scratch: Any, belief: Any) -> int:
    """One node on a running row; returns the count of hypotheses."""
    H, PH, out = scratch.H, scratch.PH, scratch.out
    _predict_all(work, count, row, node, t, scratch)
    if is_referred(node.heading_kind):
        count = _heading_all(work, count, row, node, t, scratch)
    for h in range(count):
        if node.rest > 0:
            work[h].log_weight += update_rest(work[h].mean, work[h].cov, PH, node, t)
    row.since_range_s += node.dt_s
    recover(work, count, row, node, t)
    count = expect_clear(work, count, row, node.dt_s, t)
    stuck = repeats(row, node, work[best_of(work, count)].mean[V])
    if node.kind == RANGE and row.anchor >= 0 and not stuck:
        _range_all(work, count, row, node, anchors, t, scratch, belief)
        row.since_range_s = 0.0
        count = open_alternative(work, count, row, t)
        unblock(work, count, PH, t)
    if node.kind == BEARING and row.anchor >= 0:
        anchor, primary = anchors[node.anchor], anchors[row.anchor]
        best = best_of(work, count)
        for h in range(count):
            work[h].log_weight += t.temper * update_bearing(
                work[h].mean, work[h].cov, H, PH, anchor.x - primary.x, anchor.y - primary.y, node.z, node.z_std**2, out
            )
            if h == best:
                _tell(belief, out[0], out[1], out[2])
    if not finite(work, count):
        return 0
    count = _manage(work, count, row, node, PH, t)
    for h in range(count):
        mirror(work[h].cov)
    return count


@njit(nogil=True)
def _reset(row: Any, pool: Any) -> None:
    release(row, pool)
    row.ring_count = 0
    row.ring_s = 0.0
    row.hm_started = 0
    row.model = 0
    row.referred = 0
    row.declared = 0
    row.state = layout.INITIALISING
    row.information[:] = 0.0
    row.good_s = 0.0
    row.misfit = 0.0
    row.since_nlos_s = 0.0


@njit(nogil=True)
def _continue(
    work: Any, count: int, row: Any, pool: Any, node: Any, anchors: Any, t: Tuning, scratch: Any, belief: Any
) -> int:
    """One node on any row, which starts or begins again where it must; returns the count of hypotheses."""
    if count > 0:
        watch_gap(work, count, row, node)
        if not loses_track(row, node):
            count = _step(work, count, row, node, anchors, t, scratch, belief)
            if count == 0:
                row.fault += 1
                row.reason = 10
                row.start_known = row.again = 0  # it is not there any more
                row.unwatched_s = 0.0
                _reset(row, pool)
            return count
        _reset(row, pool)
    if is_held(row, node):
        return 0
    if row.unwatched_s > 0.0:
        place_again(row, anchors[row.anchor])
    count = begin(work, row, node, anchors, t)
    for h in range(count):
        mirror(work[h].cov)
    return count


@njit(nogil=True, cache=True)
def advance(rows: Any, pool: Any, nodes: Any, anchors: Any, tuning: Any, workspace: Any, beliefs: Any) -> int:
    """Run the nodes (of one row in order of time; a row's nodes may be apart) and write one belief per node.

    Returns how many are left, because the pool has no room for another row.
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
            if pool[0].free + rows[current].count < layout.KEEP:
                return len(nodes) - k
            load(rows[current], pool, work)
            count = rows[current].count
        row = rows[current]
        row.t_ns = node.t_ns
        belief = beliefs[k]
        count = _continue(work, count, row, pool, node, anchors, t, scratch, belief)
        if count > 0:
            publish(work, count, row, node, anchors, t, belief, scratch)
        elif row.unwatched_s > 0.0:
            hold_place(row, node, anchors, belief)
        belief.state, belief.reason = row.state, row.reason
    if current >= 0:
        store(rows[current], pool, work, count)
    return 0
