"""What a row does about sensors that fail silently: a motion that nobody watched, and a radio that repeats itself.

A Gaussian about a course says nothing about a tag that drove unwatched for seconds. So such a row begins again: from
where it was, as far as it may have come since, and any heading that no reference gives.
"""

import math
from typing import Any

from .compiled import njit
from .layout import PHI, WATCHED, R, V
from .manage import best_of
from .node import RANGE
from .start import is_referred

UNWATCHED_REFERRED = 1.0  # s that a row survives without an IMU where a reference gives the heading afterwards
UNWATCHED = 0.5  # s, where none does
AGAIN_SPEED = 1.0  # m/s beyond the last one, sd of how fast it went on
FARTHEST = 1.0  # rad, of bearing: who may be further away may be anywhere
REPEATS = 3  # equal ranges after the first, of a tag that moves
REPEATS_S = 0.1  # some radios are asked more often than they measure
MOVES = 0.3  # m/s, of a tag without an accelerometer


@njit(nogil=True)
def watch_gap(work: Any, count: int, row: Any, node: Any) -> None:
    """Add up how long nobody has watched, and keep where the tag was before."""
    if node.unheard_s <= 0.0:
        return
    if row.unwatched_s == 0.0:
        best = work[best_of(work, count)]
        s, P = best.mean, best.cov
        row.gap_x, row.gap_y = s[R] * math.cos(s[PHI]), s[R] * math.sin(s[PHI])
        row.gap_var = P[R, R] + s[R] ** 2 * P[PHI, PHI]
        row.gap_speed = abs(s[V])
    row.unwatched_s += node.unheard_s


@njit(nogil=True)
def begins_again(row: Any, node: Any) -> bool:
    """The gap is over, and it was too long for what was known before."""
    if row.unwatched_s == 0.0 or node.unheard_s > 0.0:
        return False
    too_long = row.unwatched_s > (UNWATCHED_REFERRED if is_referred(node.heading_kind) else UNWATCHED)
    if not too_long:
        row.unwatched_s = 0.0
    return bool(too_long)


@njit(nogil=True)
def place_again(row: Any, anchor: Any) -> None:
    """The row's start is where the tag was, as wide as the gap makes it; unknown when that is anywhere."""
    far = (row.gap_speed + AGAIN_SPEED) * row.unwatched_s
    std = math.sqrt(row.gap_var + far * far)
    row.unwatched_s = 0.0
    row.start_heading = math.nan
    if std < FARTHEST * math.hypot(row.gap_x, row.gap_y):
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
