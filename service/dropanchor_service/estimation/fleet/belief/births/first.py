"""The first hypotheses: around a given start, or a ring of bearings and speeds at the distance of the first ranges."""

import math
from typing import Final

import numpy as np

from dropanchor_service.estimation.fleet.angles import TWO_PI, wrap
from dropanchor_service.estimation.fleet.belief.births.direction import can_turn, may_reverse
from dropanchor_service.estimation.fleet.belief.births.fix import start_at_fix
from dropanchor_service.estimation.fleet.belief.births.forgetting import MODE, PLACE, SIGHT, forget
from dropanchor_service.estimation.fleet.belief.births.numbers import FIX, GIVEN_START, RING
from dropanchor_service.estimation.fleet.belief.heading_models import reference_error, reset_models
from dropanchor_service.estimation.fleet.belief.heading_reference import add_common_rotation, add_reference_error
from dropanchor_service.estimation.fleet.belief.layout import (
    ACC_BIAS,
    EXACT,
    GYRO_BIAS,
    LEFT_BIAS,
    MOUNT,
    PHI,
    RANGE_BIAS,
    SLIP,
    START_RANGES,
    YAW,
    Anchor,
    Anchors,
    Floats,
    Hypotheses,
    Hypothesis,
    R,
    Row,
    V,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of
from dropanchor_service.estimation.fleet.belief.range_noise import learn_white
from dropanchor_service.estimation.fleet.belief.rigidity import slip_std_of
from dropanchor_service.estimation.fleet.belief.start import (
    ADOPT_VAR,
    choose_model,
    horizontal_distance,
    is_in_site_frame,
    is_yaw_known,
    start_distance,
    starts_at_place,
    uses_heading,
)
from dropanchor_service.estimation.fleet.belief.states import NO_HEADING_YET, NO_RANGE
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import (
    ABSOLUTE_HEADING,
    MEASURED_HEADING,
    MOVING,
    NO_HEADING,
    RANGE,
    RESTING,
    Node,
)
from dropanchor_service.estimation.fleet.frontend.preintegration import unobserved_turn_var
from dropanchor_service.estimation.fleet.tuning import Tuning, is_on

MIN_RANGES: Final = 5  # ranges that an unknown start needs at least
COLLECT_S: Final = 1.0  # s over which it collects them, unless it stands or START_RANGES come sooner
STANDSTILL_S: Final = 0.7  # s that it waits at least, so that a standstill is seen
RELATIVE_COURSE_VAR: Final = 1e-4  # rad^2, of a course that is the x axis of its frame
REST_SPEED_VAR: Final = 0.01  # (m/s)^2
STANDING: Final = 0.8  # share of the tags at a told start that stand


@njit(nogil=True)
def _initialise(work: Hypotheses, h: int, row: Row, node: Node, yaw: float, yaw_var: float, t: Tuning) -> None:
    """Fill all of a hypothesis that does not depend on where the tag is."""
    s, P, settings = work[h].mean, work[h].cov, row.settings
    s[:] = 0.0
    P[:] = 0.0
    s[YAW] = yaw
    s[MOUNT] = settings.mount_angle
    s[RANGE_BIAS] = settings.range_bias
    P[YAW, YAW] = yaw_var
    P[MOUNT, MOUNT] = settings.mount_angle_std**2
    P[SLIP, SLIP] = slip_std_of(row) ** 2
    P[GYRO_BIAS, GYRO_BIAS] = max(settings.gyro_bias_std**2, node.gyro_bias_var)
    P[ACC_BIAS, ACC_BIAS], P[LEFT_BIAS, LEFT_BIAS] = t.acc_bias_std**2, t.left_bias_std**2
    P[RANGE_BIAS, RANGE_BIAS] = settings.range_bias_std**2
    work[h].log_weight = 0.0
    work[h].heading_class = EXACT
    work[h].nlos = work[h].reverse = 0


@njit(nogil=True)
def _bearings(row: Row, t: Tuning) -> int:
    """Return the number of directions of a ring."""
    return t.coarse_bearings if row.start.coarse == 1 else t.start_bearings


@njit(nogil=True)
def _set_speed(one: Hypothesis, k: int, reverse: int, cell: float) -> None:
    """Give a hypothesis the k-th speed, ahead or in reverse, with a standard deviation of half a cell, m/s."""
    one.mean[V] = (1.0 - 2.0 * reverse) * cell * (k + 0.5)
    one.cov[V, V] = (cell / 2.0) ** 2
    one.reverse = reverse


@njit(nogil=True)
def _signs_at_place(row: Row, node: Node, t: Tuning) -> int:
    """Return in how many directions a tag may move at its start: 0 if it rests, or goes on after a gap.

    One that is mounted anyhow reverses as one that is mounted the other way round.
    """
    if node.rest == RESTING or row.start.after_gap == 1:
        return 0
    return 2 if row.settings.reverse_allowed == 1 and row.settings.mount_angle_std <= t.mount_cell else 1


@njit(nogil=True)
def _start_at_place(work: Hypotheses, row: Row, anchor: Anchor, node: Node, t: Tuning) -> int:
    """Make the hypotheses at the given start, with a ring of headings where none is known. Return their count.

    The place is told, and the speed is not: one stands, and others move with all speeds, unless the tag rests. After a
    gap the start is in the frame in which the tag was, and so is the speed.
    """
    start, gap = row.start, row.gap
    x, y = start.x - anchor.x, start.y - anchor.y
    r = max(math.hypot(x, y), 1e-3)
    given = math.isfinite(start.heading)
    known = is_yaw_known(row, node)
    signs = _signs_at_place(row, node, t)
    ring = 1 if known or start.free == 1 else (t.coarse_bearings if signs > 0 else _bearings(row, t))
    cell, moving = TWO_PI / ring, t.coarse_speeds * signs
    choose_model(row, node, t)
    for h in range(ring * (1 + moving)):
        yaw = start.heading if given else node.heading - row.heading.north + cell * (h % ring)
        variance = start.heading_std**2 if given else node.heading_var
        _initialise(work, h, row, node, yaw, variance if known else (cell / 2.0) ** 2, t)
        s, P = work[h].mean, work[h].cov
        s[R], s[PHI] = r, math.atan2(y, x)
        P[R, R] = start.std**2
        P[PHI, PHI] = (start.std / r) ** 2
        P[V, V] = start.speed_std**2
        if h >= ring:
            k = h // ring - 1
            _set_speed(work[h], k // signs, k % signs, _fastest(row, t) / t.coarse_speeds)
            work[h].log_weight = math.log((1.0 - STANDING) / STANDING / moving)
        if start.coarse == 1 and not known:
            turned = wrap(yaw - gap.yaw)
            work[h].log_weight = -0.5 * turned * turned / (gap.yaw_var + unobserved_turn_var(gap.turn_s))
    row.heading.in_site_frame = 0 if start.after_gap == 1 and gap.relative == 1 else 1
    if is_in_site_frame(node.heading_kind):
        _, slow, _ = reference_error(row, node.heading_var)
        for h in range(1 + moving):
            add_reference_error(work[h].cov, slow, not given)
    return int(ring * (1 + moving))


@njit(nogil=True)
def _fastest(row: Row, t: Tuning) -> float:
    """Return the greatest speed, m/s, of the first hypotheses."""
    return float(min(t.start_speed_max, row.settings.speed_max))


@njit(nogil=True)
def _start_ring(
    work: Hypotheses, row: Row, horizontal: float, node: Node, yaw: float, yaw_var: float, t: Tuning
) -> int:
    """Make hypotheses for all bearings and speeds, each with a standard deviation of half a cell. Return their count.

    Speeds are forward unless the tag may reverse. The numbers of the tuning keep the count within MAX_HYPOTHESES.
    """
    at_rest, relative = node.rest == RESTING, row.heading.in_site_frame == 0
    told = row.settings.reverse_allowed == 1
    signs = 2 if (told or (may_reverse(row, t) and can_turn(node))) and not at_rest else 1
    bearings = _bearings(row, t)
    speeds = 1 if at_rest else (t.coarse_speeds if row.start.coarse == 1 else t.start_speeds) // signs
    cell = TWO_PI / bearings
    speed_cell = _fastest(row, t) / speeds
    h = 0
    for i in range(bearings):
        for k in range(speeds):
            for g in range(signs):
                _initialise(work, h, row, node, yaw, yaw_var, t)
                s, P = work[h].mean, work[h].cov
                s[R], s[PHI] = horizontal, cell * i
                _spread_ring(P, row, cell, relative)
                if at_rest:
                    P[V, V] = REST_SPEED_VAR
                else:
                    _set_speed(work[h], k, g, speed_cell)
                if not relative and is_in_site_frame(node.heading_kind):
                    _, slow, _ = reference_error(row, node.heading_var)
                    add_common_rotation(P, slow)
                h += 1
    return h


@njit(nogil=True)
def _spread_ring(P: Floats, row: Row, cell: float, relative: bool) -> None:
    """Fill the covariance of distance and bearing of one cell of the ring.

    distance = (measured - bias) / scale, so it shares the error of the bias. An error of the mounting angle turns
    everything about the anchor: the ring covers the angle between mounting and bearing. In a frame of the tag's own
    the course is given instead, and the mounting angle turns only the body.
    """
    settings = row.settings
    bias_var = settings.range_bias_std**2
    P[R, R] = (row.noise.white_var * row.noise.factor / 4.0 + bias_var) / settings.range_scale**2
    P[R, RANGE_BIAS] = P[RANGE_BIAS, R] = -bias_var / settings.range_scale
    P[PHI, PHI] = (cell / 2.0) ** 2
    mount_var = settings.mount_angle_std**2
    if relative:
        P[YAW, YAW] += mount_var
        P[YAW, MOUNT] = P[MOUNT, YAW] = -mount_var
    else:
        P[PHI, PHI] += mount_var
        P[PHI, MOUNT] = P[MOUNT, PHI] = mount_var


@njit(nogil=True)
def collect_start(work: Hypotheses, row: Row, node: Node, anchors: Anchors, t: Tuning) -> int:
    """Collect what a start needs, and make the first hypotheses once it is there. Return their count."""
    start = row.start
    if not is_on(GIVEN_START, t):
        start.known = 0
    start.collected_s += node.dt_s
    if node.kind == RANGE and row.anchor < 0:
        row.anchor = node.anchor
    is_free = node.heading_kind == NO_HEADING
    fixed = is_on(FIX, t) and start_at_fix(row, node, anchors)
    if is_free and not fixed:
        row.publication.reason = NO_HEADING_YET
        return 0
    start.free = 1 if is_free else 0
    if node.heading_kind == MEASURED_HEADING and row.heading.models_started == 0:
        reset_models(row, node.heading, node.heading_var)
    if row.anchor < 0:
        row.publication.reason = NO_RANGE
        return 0
    anchor = anchors[row.anchor]
    north = is_in_site_frame(node.heading_kind)
    if start.after_gap == 1 and start.known == 0 and row.gap.relative == 1 and north:
        start.after_gap = 0  # the place before the gap is not one of the site
    if starts_at_place(row):
        return _start_at_place(work, row, anchor, node, t)
    if node.kind == RANGE and node.anchor == row.anchor:
        learn_white(row, node, t)
        start.ranges[start.range_count % START_RANGES] = start_distance(row, node.z)
        start.range_count += 1
    sooner = node.rest == RESTING or start.range_count >= START_RANGES
    enough = (sooner and start.collected_s >= STANDSTILL_S) or start.collected_s >= COLLECT_S
    if start.range_count < MIN_RANGES or not enough or not is_on(RING, t):
        row.publication.reason = NO_RANGE
        return 0
    slant = float(np.median(start.ranges[: min(start.range_count, START_RANGES)]))
    return _start_unknown(work, row, horizontal_distance(row, anchor, slant), node, t)


@njit(nogil=True)
def _start_unknown(work: Hypotheses, row: Row, horizontal: float, node: Node, t: Tuning) -> int:
    """Make a ring of hypotheses in the site frame if north is known, else in a frame of the tag's own.

    The x axis of such a frame is the direction in which the tag travels first. Return their count.
    """
    magnetic = node.heading_kind == ABSOLUTE_HEADING
    if is_in_site_frame(node.heading_kind) and not (magnetic and node.heading_var > ADOPT_VAR):
        choose_model(row, node, t)
        row.heading.in_site_frame = 1
        return _start_ring(work, row, horizontal, node, node.heading, node.heading_var, t)
    row.heading.in_site_frame = 0
    return _start_ring(work, row, horizontal, node, -row.settings.mount_angle, RELATIVE_COURSE_VAR, t)


@njit(nogil=True)
def restart_on_ring(work: Hypotheses, count: int, row: Row, node: Node, anchor: Anchor, t: Tuning) -> int:
    """Replace all hypotheses by a ring at the distance of the node's range. Return their count.

    The ranges contradict the track, but not its yaw: that comes from gyroscope and heading, and is kept.
    """
    best = work[best_of(work, count)]
    yaw, variance = best.mean[YAW], best.cov[YAW, YAW]
    forget(row, PLACE | MODE | SIGHT)
    row.start.coarse = 0
    node.rest = MOVING  # a standstill that was wrong may be why the track is
    horizontal = horizontal_distance(row, anchor, start_distance(row, node.z))
    if row.heading.in_site_frame == 0:
        return _start_unknown(work, row, horizontal, node, t)
    if uses_heading(row, node):
        yaw, variance = node.heading - row.heading.north, node.heading_var
    return _start_ring(work, row, horizontal, node, yaw, variance, t)
