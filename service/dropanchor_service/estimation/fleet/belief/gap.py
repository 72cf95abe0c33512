"""Sensors that fail silently: motion that no sensor observed, and a radio that repeats its last range.

A Gaussian about a course says nothing about a tag that moved unobserved for seconds. Such a row is suspended: it has
no hypotheses until its samples come again without gaps. Then it starts again from where it was, as wide as it may have
moved since, with all headings into which it may have turned.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.births.forgetting import GAP, PLACE, forget
from dropanchor_service.estimation.fleet.belief.births.numbers import AFTER_GAP
from dropanchor_service.estimation.fleet.belief.layout import (
    PHI,
    STUCK_SLOTS,
    YAW,
    Anchor,
    Anchors,
    Belief,
    Hypotheses,
    R,
    Row,
    V,
)
from dropanchor_service.estimation.fleet.belief.mixture import best_of
from dropanchor_service.estimation.fleet.belief.publish import IMU_LOST_AFTER
from dropanchor_service.estimation.fleet.belief.start import is_in_site_frame, start_distance
from dropanchor_service.estimation.fleet.belief.states import DEGRADED, IMU_MISSING, INITIALISING, LOST
from dropanchor_service.estimation.fleet.belief.summary import course_of
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MOVING, RANGE, Node
from dropanchor_service.estimation.fleet.tuning import Tuning, is_on

MAX_GAP_WITH_REFERENCE: Final = 1.0  # s that a track survives where a reference gives the heading afterwards
MAX_GAP: Final = 0.5  # s, where none does
RESUME_AFTER: Final = 0.5  # s of samples without a gap until a row starts again
RESUME_ANYWHERE_AFTER: Final = 2.0  # the same, of a row that may be anywhere
MAX_FRAGMENTS: Final = 2  # stretches of samples between gaps, after which a row waits for its own turn to start
RESTART_SPREAD: Final = 10.0  # s over which such rows start again: all at once would cost a fleet many times as much
GOLDEN_RATIO: Final = (math.sqrt(5.0) - 1.0) / 2.0  # its multiples spread neighbouring row numbers evenly
SPEED_CHANGE: Final = 1.0  # m/s, sd of the speed beyond the last one
MAX_BEARING_ERROR: Final = 1.0  # rad: a tag that may be further from where it was may be anywhere
STUCK_COUNT: Final = 3  # equal ranges after the first, of a tag that moves
STUCK_S: Final = 0.1  # s, because some radios are read more often than they measure
MOVING_SPEED: Final = 0.3  # m/s, of a tag without an accelerometer


@njit(nogil=True)
def _save_position(work: Hypotheses, count: int, row: Row) -> None:
    """Save position, course and yaw of the heaviest hypothesis, with the spread of all. Weights are normalised."""
    gap, best = row.gap, work[best_of(work, count)].mean
    x, y = best[R] * math.cos(best[PHI]), best[R] * math.sin(best[PHI])
    position, turn = 0.0, 0.0
    for h in range(count):
        s, P, weight = work[h].mean, work[h].cov, math.exp(work[h].log_weight)
        dx, dy, dyaw = s[R] * math.cos(s[PHI]) - x, s[R] * math.sin(s[PHI]) - y, wrap(s[YAW] - best[YAW])
        position += weight * (P[R, R] + s[R] ** 2 * P[PHI, PHI] + dx * dx + dy * dy)
        turn += weight * (P[YAW, YAW] + dyaw * dyaw)
    gap.x, gap.y, gap.var = x, y, position
    gap.speed, gap.course = abs(best[V]), course_of(best)
    gap.yaw, gap.yaw_var = best[YAW], turn
    gap.relative = 1 - row.heading.in_site_frame
    gap.turn_s = gap.observed_s = 0.0
    gap.fragments = 0


@njit(nogil=True)
def accumulate_gap(work: Hypotheses, count: int, row: Row, node: Node) -> None:
    """Add the node's unobserved time to the gap. At its beginning save where the tag was."""
    if node.unobserved_s <= 0.0:
        return
    if row.gap.unobserved_s == 0.0:
        _save_position(work, count, row)
    row.gap.turn_s += node.unobserved_s
    row.gap.unobserved_s += node.unobserved_s


@njit(nogil=True)
def is_track_lost(row: Row, node: Node) -> bool:
    """Return whether the gap is too long for the hypotheses before it. Forget a short gap that is over."""
    gap = row.gap
    if gap.unobserved_s == 0.0:
        return False
    reference = node.unobserved_s > 0.0 or is_in_site_frame(node.heading_kind)
    too_long = gap.unobserved_s > (MAX_GAP_WITH_REFERENCE if reference else MAX_GAP)
    if not too_long and node.unobserved_s <= 0.0:
        gap.unobserved_s = 0.0
    return bool(too_long)


@njit(nogil=True)
def is_suspended(row: Row, node: Node) -> bool:
    """Return whether a row that lost its track waits, until its samples have come without a gap for a while.

    Otherwise a row whose samples come in fragments would start again, with many hypotheses, after each of them.
    """
    gap = row.gap
    if gap.unobserved_s == 0.0:
        return False
    gap.unobserved_s += node.dt_s
    gap.turn_s += node.unobserved_s
    gap.yaw += node.dyaw
    row.since_range_s = 0.0 if node.kind == RANGE else row.since_range_s + node.dt_s
    if node.unobserved_s > 0.0:
        gap.fragments = min(gap.fragments + (gap.observed_s > 0.0), MAX_FRAGMENTS)
        gap.observed_s = 0.0
    else:
        gap.observed_s += node.dt_s
    resume_after = RESUME_AFTER if _is_position_known(row) else RESUME_ANYWHERE_AFTER
    return bool(gap.observed_s < resume_after + _restart_delay(row, node))


@njit(nogil=True)
def _restart_delay(row: Row, node: Node) -> float:
    """Return how long, s, the row waits for its turn: by its number, so that equal samples give equal poses."""
    return RESTART_SPREAD * (node.row * GOLDEN_RATIO % 1.0) if row.gap.fragments >= MAX_FRAGMENTS else 0.0


@njit(nogil=True)
def _position_variance(row: Row) -> float:
    """Return the variance, m^2, of each coordinate now: the tag was there, and went on."""
    gap = row.gap
    distance = (gap.speed + SPEED_CHANGE) * gap.unobserved_s
    return float(gap.var + distance * distance)


@njit(nogil=True)
def _is_position_known(row: Row) -> bool:
    """Return whether the position before the gap still says where the tag is."""
    return bool(_position_variance(row) < (MAX_BEARING_ERROR * math.hypot(row.gap.x, row.gap.y)) ** 2)


@njit(nogil=True)
def publish_suspended(row: Row, node: Node, anchors: Anchors, belief: Belief) -> None:
    """Publish a suspended row: the direction in which the tag was, at the distance of its newest range."""
    gap, publication = row.gap, row.publication
    anchor, r = anchors[row.anchor], max(math.hypot(gap.x, gap.y), 1e-3)
    if node.kind == RANGE and node.anchor == row.anchor:
        slant, dz = start_distance(row, node.z), row.settings.height - anchor.z
        distance = math.sqrt(max(slant**2 - dz * dz, 0.01))
        gap.x, gap.y, r = gap.x * distance / r, gap.y * distance / r, distance
    variance = min(_position_variance(row), 4.0 * r * r)
    belief.x, belief.y = gap.x + anchor.x, gap.y + anchor.y
    belief.course = belief.yaw = gap.course
    belief.speed, belief.yaw_rate = gap.speed, 0.0
    belief.cov[0, 0] = belief.cov[1, 1] = variance
    belief.cov[2, 2] = math.pi**2 / 3.0
    belief.p_mode, belief.sigma_pos, belief.sigma_obs = 1.0, math.sqrt(2.0 * variance), math.inf
    belief.hypotheses, belief.relative = 1, gap.relative
    publication.state = LOST if gap.unobserved_s > IMU_LOST_AFTER else DEGRADED
    publication.reason = IMU_MISSING


@njit(nogil=True)
def restart_from_gap(row: Row, anchor: Anchor, t: Tuning) -> None:
    """Set the row's start to where the tag was, as wide as the gap makes it, or to unknown if that is anywhere."""
    gap, start = row.gap, row.start
    known, std = is_on(AFTER_GAP, t) and _is_position_known(row), math.sqrt(_position_variance(row))
    forget(row, GAP)
    start.heading = start.other_x = math.nan
    start.coarse, row.publication.state = 1, INITIALISING
    if known:
        start.after_gap = 1
        start.x, start.y = gap.x + anchor.x, gap.y + anchor.y
        start.std = std
        start.speed_std = gap.speed + SPEED_CHANGE
    else:
        forget(row, PLACE)


@njit(nogil=True)
def is_stuck(row: Row, node: Node, speed: float) -> bool:
    """Return whether a radio gives the same range to one anchor again and again although the tag moves."""
    if node.kind != RANGE:
        return False
    last = row.stuck
    slot = node.anchor % STUCK_SLOTS
    if node.z != last.z[slot] or node.anchor != last.anchor[slot]:
        last.anchor[slot], last.z[slot] = node.anchor, node.z
        last.count[slot], last.t_ns[slot] = 0, node.t_ns
        return False
    last.count[slot] += 1
    long_enough = (node.t_ns - last.t_ns[slot]) * 1e-9 >= STUCK_S
    moves = node.rest == MOVING if math.isfinite(node.dv_var) else abs(speed) > MOVING_SPEED
    return last.count[slot] >= STUCK_COUNT and long_enough and moves
