"""What a track becomes when somebody corrects the place of an anchor.

A track is polar around its primary anchor, so with one anchor it shifts with it, and nothing is lost. A track that
other anchors or a told start hold keeps its place instead. It begins again there, as unsure as the correction is large:
what it learned of headings and noise is from ranges that contradicted each other.
"""

import math
from typing import Final

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.births.direction import DRIVEN
from dropanchor_service.estimation.fleet.belief.births.forgetting import GAP, NOISE, SIGHT, TRACK, forget
from dropanchor_service.estimation.fleet.belief.gap import SPEED_CHANGE
from dropanchor_service.estimation.fleet.belief.layout import PHI, YAW, N, Pool, R, Row, V
from dropanchor_service.estimation.fleet.belief.pool import release, slots_of
from dropanchor_service.estimation.fleet.compiled import njit

HEARD_NS: Final = 60_000_000_000  # an anchor that a tag heard longer ago does not hold its track
SAME_M: Final = 1e-6  # what rounding leaves is no difference of two ways
NEAREST_M: Final = 0.1  # a slant distance is not shortened below it
DILUTED: Final = 2.0  # by how much further than an anchor a place is off that several anchors gave


def follow_moved(rows: Array, pool: Array, before: Array, after: Array) -> Array:
    """Let ROW and their hypotheses follow anchors from `before` to `after`, ANCHOR, in place.

    Return the rows that cannot, because they did not know where they are: they have to start afresh.
    """
    by = np.column_stack([after[name] - before[name] for name in ("x", "y", "z")])
    numbers = _concerned(rows, np.flatnonzero(by.any(axis=1)))
    if not len(numbers):
        return numbers
    _lift(rows, pool, numbers, before, after)
    kept, far = _keep_places(rows[numbers], by)
    _shift_gaps(rows, numbers[~kept], by)
    afresh = []
    for number, distance in zip(numbers[kept].tolist(), far[kept].tolist(), strict=True):
        primary = before[rows["anchor"][number]]
        if not begin_again(rows[number], pool, float(primary["x"]), float(primary["y"]), distance):
            afresh.append(number)
    return np.array(afresh, np.int64)


def _concerned(rows: Array, anchors: Array) -> Array:
    """Return the numbers of the ROW that count from one of these anchors, or hear it."""
    heard = (np.isin(rows["stuck"]["anchor"], anchors) & _is_fresh(rows)).any(axis=1)
    numbers: Array = np.flatnonzero((rows["anchor"] >= 0) & (np.isin(rows["anchor"], anchors) | heard))
    return numbers


def _is_fresh(rows: Array) -> Array:
    """Return which of the last ranges of ROW are from a short while ago."""
    heard_ns = rows["stuck"]["t_ns"]
    fresh: Array = (heard_ns > 0) & (heard_ns > rows["t_ns"][:, None] - HEARD_NS)
    return fresh


def _keep_places(rows: Array, by: Array) -> tuple[Array, Array]:
    """Return which ROW keep their places, and how far, m, the anchor moved that moved furthest of those they hear.

    The others hear only anchors that moved alike, and no told start holds them. by: m, of every anchor.
    """
    primary = by[rows["anchor"]][:, None, :]
    heard = np.where(_is_fresh(rows)[:, :, None], by[rows["stuck"]["anchor"]], primary)
    differ = (np.abs(heard - primary) > SAME_M).any(axis=(1, 2))
    far = np.linalg.norm(np.concatenate([primary, heard], axis=1), axis=2).max(axis=1)
    held = (rows["start"]["known"] == 1) & (np.hypot(primary[:, 0, 0], primary[:, 0, 1]) > SAME_M)
    return differ | held, far


def _lift(rows: Array, pool: Array, numbers: Array, before: Array, after: Array) -> None:
    """Keep the slant distance of tracks whose primary anchor is higher or lower now: it is what ranges measure."""
    slots, of_slot = slots_of(rows[numbers], pool), np.repeat(numbers, rows["count"][numbers])
    anchor, height = rows["anchor"][of_slot], rows["settings"]["height"][of_slot]
    squares = (height - before["z"][anchor]) ** 2 - (height - after["z"][anchor]) ** 2
    lifted = slots[squares != 0.0]
    level = pool["mean"][lifted, R] ** 2 + squares[squares != 0.0]
    pool["mean"][lifted, R] = np.sqrt(np.maximum(level, NEAREST_M**2))


def _shift_gaps(rows: Array, numbers: Array, by: Array) -> None:
    """Shift where tags were before a gap: it counts from the zero of the site while their tracks begin again."""
    start = rows["start"]
    in_gap = numbers[(start["after_gap"][numbers] == 1) & (start["known"][numbers] == 0)]
    for axis, name in enumerate(("x", "y")):
        start[name][in_gap] += by[rows["anchor"][in_gap], axis]


@njit(nogil=True, cache=True)
def begin_again(row: Row, pool: Pool, x: float, y: float, far: float) -> bool:
    """Let a row begin again where its heaviest hypothesis is, or at the told start that it has not left yet.

    (x, y): of its primary anchor. far: m, how wrong the place may be. Return whether it knew where it is.
    """
    start = row.start
    at_start = start.known == 1 and start.way < DRIVEN
    if not at_start:
        if row.count == 0 or row.publication.resolved == 0:
            return False
        _start_here(row, pool, x, y, far)
    release(row, pool, 0)
    forget(row, TRACK | GAP | SIGHT | NOISE)
    return True


@njit(nogil=True)
def _start_here(row: Row, pool: Pool, x: float, y: float, far: float) -> None:
    """Set the row's start to where its heaviest hypothesis is, as after a gap."""
    start, slot = row.start, row.first_slot
    best = slot
    for _ in range(row.count):
        if pool[slot].log_weight > pool[best].log_weight:
            best = slot
        slot = pool[slot].next
    s, cov = pool[best].mean, pool[best].cov
    start.x, start.y = x + s[R] * math.cos(s[PHI]), y + s[R] * math.sin(s[PHI])
    start.std = math.sqrt(cov[R] + s[R] ** 2 * cov[N * PHI] + (DILUTED * far) ** 2)
    start.speed_std = abs(s[V]) + SPEED_CHANGE
    start.heading = math.nan
    start.known, start.after_gap, start.coarse = 0, 1, 1
    gap = row.gap
    gap.yaw, gap.yaw_var, gap.turn_s = s[YAW], math.pi**2, 0.0
    gap.relative = 1 - row.heading.in_site_frame
