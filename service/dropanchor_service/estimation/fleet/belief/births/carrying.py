"""A tag that is picked up, carried off or set down, and a device that turns without its carrier.

A person may hold a device in any way, so the hypotheses of a carried tag have mounting angles all around.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.angles import TWO_PI, wrap
from dropanchor_service.estimation.fleet.belief.births.forgetting import SIGHT, forget
from dropanchor_service.estimation.fleet.belief.births.numbers import (
    CARRIED_START,
    DEVICE_TURN,
    PICK_UP,
    SET_DOWN,
    WALKED_OFF,
)
from dropanchor_service.estimation.fleet.belief.heading_reference import is_of_another_axis, restart_reference
from dropanchor_service.estimation.fleet.belief.layout import (
    ACC_BIAS,
    GAIT_OFFSET,
    GYRO_BIAS,
    LEFT_BIAS,
    MOUNT,
    PHI,
    RANGE_BIAS,
    SLIP,
    STEP_SCALE,
    YAW,
    Floats,
    Hypotheses,
    Hypothesis,
    R,
    Row,
    V,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of, clear_state, copy_hypothesis, gets_child
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MEASURED_HEADING, Node
from dropanchor_service.estimation.fleet.measurement.scalar import gaussian
from dropanchor_service.estimation.fleet.tuning import Tuning, is_on

RING_MOUNT_STD: Final = 1.2  # rad, of the mounting angle of somebody's device, as one Gaussian
USUAL_SPEED: Final = 1.2  # m/s, of a walk
BRANCH_DEPTH: Final = 4.0  # log weight below the best at which a hypothesis gets no child
ANY_DIRECTION_VAR: Final = math.pi**2  # rad^2, so wide that one direction is hardly likelier than another
MOUNT_KNOWN: Final = 0.3  # rad, of a mounting angle that the operator knows


@njit(nogil=True)
def follow_motion(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Make the hypotheses those of what moves the tag now. Return their count."""
    _keep_motion(row, node, t)
    if row.walk.carried == node.carried:
        if node.carried == 0 and (node.walked == 0.0 or row.walk.var == 0.0):
            s, P = work[best_of(work, count)].mean, work[best_of(work, count)].cov
            row.walk.x, row.walk.y = row.publication.x, row.publication.y  # before its first steps
            row.walk.var = P[R, R] + s[R] ** 2 * P[PHI, PHI]
        return count
    if node.carried == 1 and _is_too_fast(work[best_of(work, count)], t):
        node.carried = 0
        return count
    row.walk.carried = node.carried
    if node.carried == 0:
        _set_down(work, count, row, t)
        return count
    if node.heading_kind == MEASURED_HEADING:
        restart_reference(work[best_of(work, count)], row, node.heading - node.dyaw, node.heading_var)
    return _pick_up(work, count, row, node, t)


@njit(nogil=True)
def _keep_motion(row: Row, node: Node, t: Tuning) -> None:
    """Let nothing change what moves the tag where that change is switched off."""
    if row.walk.carried == 0 and not is_on(PICK_UP, t):
        node.carried = 0
    elif row.walk.carried == 1 and not is_on(SET_DOWN, t):
        node.carried = 1


@njit(nogil=True)
def start_carried(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Make the first hypotheses those of a carried tag. Return their count."""
    if not is_on(CARRIED_START, t):
        return count
    row.walk.carried = 1
    if row.start.known == 1 and row.start.after_gap == 0:
        s, P = work[0].mean, work[0].cov
        row.walk.x, row.walk.y = s[R] * math.cos(s[PHI]), s[R] * math.sin(s[PHI])
        row.walk.var = P[R, R] + s[R] ** 2 * P[PHI, PHI]
        return _pick_up(work, count, row, node, t)
    for h in range(count):
        _become_carried(work[h], row, node, t)
        widen_common_mount(work[h].cov, row)
    return count


@njit(nogil=True)
def was_walked_off(row: Row, node: Node, t: Tuning) -> bool:
    """Return whether a person carries a tag whose place was not known when the steps began.

    Its hypotheses are those of a vehicle that the steps accelerated, and no others are left.
    """
    unknown = row.publication.resolved == 0 and row.start.known == 0
    steps = node.carried == 1 and row.walk.carried == 0
    allowed = is_on(WALKED_OFF, t) and is_on(CARRIED_START, t)  # else it would start so again and again
    return bool(unknown and steps and allowed)


@njit(nogil=True)
def _is_too_fast(one: Hypothesis, t: Tuning) -> bool:
    """Return whether nobody walks as fast: what looks like steps are bumps."""
    return bool(one.mean[V] - 3.0 * math.sqrt(one.cov[V, V]) > t.walk_speed_max)


@njit(nogil=True)
def _become_carried(one: Hypothesis, row: Row, node: Node, t: Tuning) -> None:
    """Replace what a vehicle's hypothesis says of speed, slip and accelerometer."""
    s, P = one.mean, one.cov
    one.reverse = 0
    for i in (V, SLIP, GAIT_OFFSET, STEP_SCALE, GYRO_BIAS):
        s[i] = 0.0
    clear_state(P, V, t.walk_speed_std**2)
    clear_state(P, SLIP, t.sway_std**2)
    clear_state(P, GAIT_OFFSET, ANY_DIRECTION_VAR if is_of_another_axis(row, node) else t.gait_offset_std**2)
    clear_state(P, STEP_SCALE, t.step_scale_std**2)
    clear_state(P, GYRO_BIAS, t.walk_gyro_bias_std**2)  # a rest in the hand, or shaking, may have taught a wrong one
    s[V] = USUAL_SPEED if node.walked > 0.0 else 0.0


@njit(nogil=True)
def widen_common_mount(P: Floats, row: Row) -> None:
    """Widen the mounting angle to that of anybody's device, and with it the bearing of a ring.

    In a frame of the tag's own the course is given, so the yaw takes the error instead of the bearing.
    """
    more = RING_MOUNT_STD**2 - row.settings.mount_angle_std**2
    if row.settings.mount_angle_std < MOUNT_KNOWN:
        return
    other, sign = (PHI, 1.0) if row.heading.in_site_frame == 1 else (YAW, -1.0)
    P[MOUNT, MOUNT] += more
    P[other, other] += more
    P[other, MOUNT] += sign * more
    P[MOUNT, other] = P[other, MOUNT]


@njit(nogil=True)
def _pick_up(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> int:
    """Put one hypothesis per way to hold the device where the steps since the walk began lead. Return their count."""
    copy_hypothesis(work, best_of(work, count), 0)
    one = work[0]
    one.log_weight = 0.0
    _become_carried(one, row, node, t)
    _see_again(one, row)
    known = row.settings.mount_angle_std < MOUNT_KNOWN
    cells = 1 if known else t.grips
    cell = TWO_PI / t.grips
    if not known:
        clear_state(one.cov, MOUNT, (cell / 2.0) ** 2)
    for h in range(cells - 1, -1, -1):
        copy_hypothesis(work, 0, h)
        one = work[h]
        if not known:
            angle = wrap(cell * h)
            one.mean[MOUNT] = angle
            density = t.front_share * gaussian(angle, t.front_std**2) + (1.0 - t.front_share) / TWO_PI
            one.log_weight = math.log(density)
        _walk_from_origin(one, row, node, t)
    return cells


@njit(nogil=True)
def _see_again(one: Hypothesis, row: Row) -> None:
    """Take back what the steps since were explained with: a line of sight that is lost, and a track that is wrong."""
    if one.nlos == 1:
        one.nlos = 0
        one.mean[RANGE_BIAS] = one.los_bias
        clear_state(one.cov, RANGE_BIAS, one.los_bias_var)
    forget(row, SIGHT)


@njit(nogil=True)
def _walk_from_origin(one: Hypothesis, row: Row, node: Node, t: Tuning) -> None:
    """Move the hypothesis from where the tag stood last by the steps since, along its course."""
    s, P, walk = one.mean, one.cov, row.walk
    course = s[YAW] + node.dyaw + s[MOUNT] + s[SLIP]  # the node is predicted later
    x, y = walk.x + node.walked * math.cos(course), walk.y + node.walked * math.sin(course)
    variance = walk.var + t.walk_start_var + (t.walk_start_share * node.walked) ** 2
    s[R], s[PHI] = max(math.hypot(x, y), 0.1), math.atan2(y, x)
    clear_state(P, R, variance)
    clear_state(P, PHI, variance / s[R] ** 2)


@njit(nogil=True)
def _set_down(work: Hypotheses, count: int, row: Row, t: Tuning) -> None:
    """Make all hypotheses those of a vehicle whose mounting angle is not known."""
    for h in range(count):
        s, P = work[h].mean, work[h].cov
        s[ACC_BIAS] = s[LEFT_BIAS] = s[SLIP] = 0.0
        clear_state(P, ACC_BIAS, t.acc_bias_std**2)
        clear_state(P, LEFT_BIAS, t.left_bias_std**2)
        clear_state(P, SLIP, row.settings.slip_std**2)
        P[MOUNT, MOUNT] += row.settings.mount_angle_std**2
        P[V, V] += t.walk_speed_std**2


@njit(nogil=True)
def turn_device(work: Hypotheses, count: int, node: Node, t: Tuning) -> int:
    """Copy hypotheses after a quick turn, for a device that turned and not its carrier. Return the count."""
    if node.carried == 0 or node.turned == 0.0 or not is_on(DEVICE_TURN, t):
        return count
    top = work[best_of(work, count)].log_weight
    for h in range(count):
        if gets_child(work, h, count, top, BRANCH_DEPTH):
            copy_hypothesis(work, h, count)
            child = work[count]
            child.mean[MOUNT] = wrap(child.mean[MOUNT] - node.turned)
            child.cov[R, R] += t.device_turn_var
            child.cov[PHI, PHI] += t.device_turn_var / max(child.mean[R], 1.0) ** 2
            child.cov[MOUNT, MOUNT] += (t.device_turn_share * node.turned) ** 2
            child.log_weight += t.device_turn_log_prior
            count += 1
    return count
