"""What a row does about sensors that fail silently: a motion that nobody watched, and a radio that repeats itself.

A Gaussian about a course says nothing about a tag that drove unwatched for seconds. So such a row is held where it was,
without hypotheses, until its samples come again without gaps; then it begins again: from where it was, as far as it may
have come since, with the headings into which it may have turned.
"""

import math
from typing import Any

from dropanchor_service.estimation.fleet.belief.layout import DEGRADED, INITIALISING, LOST, PHI, WATCHED, YAW, R, V
from dropanchor_service.estimation.fleet.belief.mixture import best_of
from dropanchor_service.estimation.fleet.belief.start import is_referred
from dropanchor_service.estimation.fleet.belief.summary import course_of
from dropanchor_service.estimation.fleet.belief.update import wrap
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import RANGE

UNWATCHED_REFERRED = 1.0  # s that a row survives without an IMU where a reference gives the heading afterwards
UNWATCHED = 0.5  # s, where none does
WATCHED_AGAIN = 0.5  # s without a gap, until a row that lost its track begins again
WATCHED_ANYWHERE = 2.0  # the same, where it may be anywhere
PIECES = 2  # of samples between gaps, from which on a row waits for its turn
TURNS = 10.0  # s over which such rows begin again: a fleet that is hit together would need many times what it costs
GOLDEN = 0.6180339887498949  # of which the multiples of neighbouring numbers are far apart
UNWATCHED_LOST = 10.0  # s
AGAIN_SPEED = 1.0  # m/s beyond the last one, sd of how fast it went on
FARTHEST = 1.0  # rad, of bearing: who may be further away may be anywhere
REPEATS = 3  # equal ranges after the first, of a tag that moves
REPEATS_S = 0.1  # some radios are asked more often than they measure
MOVES = 0.3  # m/s, of a tag without an accelerometer


@njit(nogil=True)
def _keep_place(work: Any, count: int, row: Any) -> None:
    """Place, course and yaw of the heaviest hypothesis, as uncertain as all are about it. Weights are normalised."""
    best = work[best_of(work, count)].mean
    x, y = best[R] * math.cos(best[PHI]), best[R] * math.sin(best[PHI])
    place, turn = 0.0, 0.0
    for h in range(count):
        s, P, weight = work[h].mean, work[h].cov, math.exp(work[h].log_weight)
        dx, dy, dyaw = s[R] * math.cos(s[PHI]) - x, s[R] * math.sin(s[PHI]) - y, wrap(s[YAW] - best[YAW])
        place += weight * (P[R, R] + s[R] ** 2 * P[PHI, PHI] + dx * dx + dy * dy)
        turn += weight * (P[YAW, YAW] + dyaw * dyaw)
    row.gap_x, row.gap_y, row.gap_var = x, y, place
    row.gap_speed, row.gap_course = abs(best[V]), course_of(best)
    row.gap_yaw, row.gap_yaw_var = best[YAW], turn
    row.gap_unheard = row.watched_s = 0.0
    row.pieces = 0


@njit(nogil=True)
def watch_gap(work: Any, count: int, row: Any, node: Any) -> None:
    """Add up how long nobody has watched, and keep where the tag was before."""
    if node.unheard_s <= 0.0:
        return
    if row.unwatched_s == 0.0:
        _keep_place(work, count, row)
    row.gap_unheard += node.unheard_s
    row.unwatched_s += node.unheard_s


@njit(nogil=True)
def loses_track(row: Any, node: Any) -> bool:
    """The gap is too long for what was known before; one that is over and was not is forgotten."""
    if row.unwatched_s == 0.0:
        return False
    referred = node.unheard_s > 0.0 or is_referred(node.heading_kind)
    too_long = row.unwatched_s > (UNWATCHED_REFERRED if referred else UNWATCHED)
    if not too_long and node.unheard_s <= 0.0:
        row.unwatched_s = 0.0
    return bool(too_long)


@njit(nogil=True)
def is_held(row: Any, node: Any) -> bool:
    """A row that lost its track waits until it has been watched for a while, so that one whose samples come in pieces
    does not begin again, with many hypotheses, after every piece."""
    if row.unwatched_s == 0.0:
        return False
    row.unwatched_s += node.dt_s
    row.gap_unheard += node.unheard_s
    row.gap_yaw += node.dyaw
    row.since_range_s = 0.0 if node.kind == RANGE else row.since_range_s + node.dt_s
    if node.unheard_s > 0.0:
        row.pieces = min(row.pieces + (row.watched_s > 0.0), PIECES)
        row.watched_s = 0.0
    else:
        row.watched_s += node.dt_s
    return bool(row.watched_s < (WATCHED_AGAIN if _is_near(row) else WATCHED_ANYWHERE) + _turn(row, node))


@njit(nogil=True)
def _turn(row: Any, node: Any) -> float:
    """s that the row waits for its turn: by its number, so that the same samples give the same poses."""
    return TURNS * (node.row * GOLDEN % 1.0) if row.pieces >= PIECES else 0.0


@njit(nogil=True)
def _widened(row: Any) -> float:
    """Variance, m^2, of each coordinate after so long: it was there, and went on."""
    far = (row.gap_speed + AGAIN_SPEED) * row.unwatched_s
    return float(row.gap_var + far * far)


@njit(nogil=True)
def _is_near(row: Any) -> bool:
    """Where it was still says where it is."""
    return bool(_widened(row) < (FARTHEST * math.hypot(row.gap_x, row.gap_y)) ** 2)


@njit(nogil=True)
def hold_place(row: Any, node: Any, anchors: Any, belief: Any) -> None:
    """What is published of a row that is held: the direction in which the tag was, at the distance of its ranges."""
    anchor, r = anchors[row.anchor], max(math.hypot(row.gap_x, row.gap_y), 1e-3)
    if node.kind == RANGE and node.anchor == row.anchor:
        slant, dz = node.z / row.range_scale - row.offset, row.height - anchor.z
        distance = math.sqrt(max(slant**2 - dz * dz, 0.01))
        row.gap_x, row.gap_y, r = row.gap_x * distance / r, row.gap_y * distance / r, distance
    variance = min(_widened(row), 4.0 * r * r)
    belief.x, belief.y = row.gap_x + anchor.x, row.gap_y + anchor.y
    belief.course = belief.yaw = row.gap_course
    belief.speed, belief.yaw_rate = row.gap_speed, 0.0
    belief.cov[0, 0] = belief.cov[1, 1] = variance
    belief.cov[2, 2] = math.pi**2 / 3.0
    belief.p_mode, belief.sigma_pos, belief.sigma_obs = 1.0, math.sqrt(2.0 * variance), math.inf
    belief.hypotheses = 1
    row.state, row.reason = LOST if row.unwatched_s > UNWATCHED_LOST else DEGRADED, 6


@njit(nogil=True)
def place_again(row: Any, anchor: Any) -> None:
    """The row's start is where the tag was, as wide as the gap makes it; unknown when that is anywhere."""
    near, std = _is_near(row), math.sqrt(_widened(row))
    row.unwatched_s = 0.0
    row.start_heading = math.nan
    row.coarse, row.state = 1, INITIALISING
    if near:
        row.again = 1
        row.start_x, row.start_y = row.gap_x + anchor.x, row.gap_y + anchor.y
        row.start_std = std
        row.start_speed_std = row.gap_speed + AGAIN_SPEED
    else:
        row.again = 0
        row.start_known = 0


@njit(nogil=True)
def repeats(row: Any, node: Any, speed: float) -> bool:
    """Whether a radio gives the same range of one anchor again and again although the tag moves."""
    if node.kind != RANGE:
        return False
    slot = node.anchor % WATCHED
    if node.z != row.last_z[slot] or node.anchor != row.last_anchor[slot]:
        row.last_anchor[slot], row.last_z[slot] = node.anchor, node.z
        row.same_count[slot], row.same_ns[slot] = 0, node.t_ns
        return False
    row.same_count[slot] += 1
    lasts = (node.t_ns - row.same_ns[slot]) * 1e-9 >= REPEATS_S
    moves = node.rest == 0 if math.isfinite(node.dv_var) else abs(speed) > MOVES
    return row.same_count[slot] >= REPEATS and lasts and moves
