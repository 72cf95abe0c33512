"""Decide which tags enter and leave which zones: the kernel, and the memory that it works on."""

from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.heights import p_between
from dropanchor_service.zones.probability import p_inside

ENTER_P: Final = 0.9  # of being inside
EXIT_P: Final = 0.9  # of being outside
MAX_GAP_NS: Final = 5_000_000_000  # between two poses of a tag: a longer silence starts every delay again
NEAR: Final = 4.0  # standard deviations: a zone that is farther away cannot hold more than 0.01 % of the tag
SLOWER: Final = 0.9  # of the limit: below it, a tag can be too fast again

INSIDE, DWELT, TOO_FAST = 1, 2, 4  # flags of a tag in a zone
ENTER, EXIT, DWELL, SPEED, SLOW = 0, 1, 2, 3, 4  # kinds of Change; SLOW: no longer too fast
PER_PAIR: Final = 3  # changes that one pose can cause in one zone

STAY = np.dtype(
    [("flags", "u1"), ("since_ns", "i8"), ("pending_ns", "i8"), ("fast_ns", "i8"), ("seen_ns", "i8")], align=True
)
"""A tag in a zone. since_ns: when it entered. pending_ns, fast_ns: since when it seems to have changed sides, or to be
too fast; 0: it does not. seen_ns: the last pose that was not surely outside; 0: none since the start of the service."""

CHANGE = np.dtype([("kind", "u1"), ("pose", "i4"), ("zone", "i4"), ("since_ns", "i8"), ("p", "f8")])

MODE = np.dtype([("weight", "f8"), ("x", "f8"), ("y", "f8"), ("cov", "f8", (2, 2))])
"""One Gaussian of the position of a tag. The weights of a tag sum to at most 1; the rest may be anywhere."""


class Poses(NamedTuple):
    """Poses of tags, in columns. z, z_std: NaN where the height is not known. first: index of the first MODE of each
    pose, and the end."""

    rows: Array
    t_ns: Array
    speeds: Array
    z: Array
    z_std: Array
    first: Array
    modes: Array


class Zones(NamedTuple):
    """Zones of one or several sites, in columns: those of one site after those of the other.

    vertices: n × 2, of one zone after the other. first: index of the first vertex of each zone, and the end. boxes:
    (x min, y min, x max, y max). low, high: of its heights, infinite: no end. dwell_ns: -1: no rule. speed: m/s,
    infinite: no rule. sites: index of the first zone of each site, and the end.
    """

    vertices: Array
    first: Array
    boxes: Array
    low: Array
    high: Array
    delay_ns: Array
    dwell_ns: Array
    speed: Array
    sites: Array


class Memory(NamedTuple):
    """What is known of the tags (rows) and the zones of their sites (columns).

    sites: by row, the index of the tag's site. judged_ns: by row, the time of the last pose. concerned: whether the
    zone concerns the tag. stays: STAY. touched: whether a STAY is not zero; most are zero and need not be read.
    """

    sites: Array
    judged_ns: Array
    concerned: Array
    stays: Array
    touched: Array


@njit(cache=True, nogil=True)
def judge(poses: Poses, zones: Zones, memory: Memory, begin: int, changes: Any) -> tuple[int, int]:
    """Update the memory with the poses from `begin` on, and fill `changes`.

    Return the number of changes, and the index of the first pose that was not judged for lack of room.
    """
    boxes, count = zones.boxes, 0
    low, high = np.empty(2), np.empty(2)
    for i in range(begin, len(poses.rows)):
        row, now = poses.rows[i], poses.t_ns[i]
        first, end = zones.sites[memory.sites[row]], zones.sites[memory.sites[row] + 1]
        if count + PER_PAIR * (end - first) > len(changes):
            return count, i
        continues = 0 < now - memory.judged_ns[row] <= MAX_GAP_NS
        memory.judged_ns[row] = now
        modes = poses.modes[poses.first[i] : poses.first[i + 1]]
        weight = _extent(modes, low, high)
        low_x, low_y, high_x, high_y = low[0], low[1], high[0], high[1]
        for z in range(first, end):
            is_far = low_x > boxes[z, 2] or high_x < boxes[z, 0] or low_y > boxes[z, 3] or high_y < boxes[z, 1]
            column = z - first
            if (is_far and not memory.touched[row, column]) or not memory.concerned[row, column]:
                continue
            inside = 0.0 if is_far else _inside(modes, boxes[z], zones.vertices, zones.first[z], zones.first[z + 1])
            stay, before = memory.stays[row, column], count
            inside, known = _at_height(inside, weight, poses.z[i], poses.z_std[i], zones.low[z], zones.high[z])
            count = _follow(stay, zones, z, inside, known, now, continues, poses.speeds[i], changes, count)
            for k in range(before, count):
                changes[k].pose, changes[k].zone = i, z
            memory.touched[row, column] = stay.flags != 0 or stay.pending_ns != 0
    return count, len(poses.rows)


@njit(cache=True, nogil=True)
def _at_height(inside: float, weight: float, z: float, std: float, low: float, high: float) -> tuple[float, float]:
    """Return how much of the tag is in the zone with these heights, and of how much of it that is known.

    inside: how much is in its area. A tag whose height is not known may be outside, but not inside.
    """
    if low == -np.inf and high == np.inf:
        return inside, weight
    if np.isnan(z):
        return 0.0, weight - inside
    return inside * p_between(z, std, low, high), weight


@njit(cache=True, nogil=True)
def _follow(
    stay: Any,
    zones: Zones,
    z: int,
    inside: float,
    weight: float,
    now: int,
    continues: bool,
    speed: float,
    changes: Any,
    count: int,
) -> int:
    """Update the STAY of a tag in zone z, and add to `changes`. Return their new number.

    inside: how much of the tag is in the zone, of the `weight` that is known. continues: the last pose was just before.
    """
    delay_ns = zones.delay_ns[z]
    if _turned(stay, inside, weight - inside, now, continues, delay_ns):
        stay.flags = (stay.flags ^ INSIDE) & INSIDE
        stay.since_ns, stay.pending_ns, stay.fast_ns = stay.pending_ns, 0, 0
        if stay.flags:
            stay.seen_ns = now
            count = _note(changes, count, ENTER, stay.since_ns, inside)
        else:
            count = _note(changes, count, EXIT, stay.since_ns, weight - inside)
    if not stay.flags & INSIDE:
        return count
    stay.since_ns = min(stay.since_ns, now)
    if zones.dwell_ns[z] >= 0 and not stay.flags & DWELT and now - stay.since_ns >= zones.dwell_ns[z]:
        stay.flags |= DWELT
        count = _note(changes, count, DWELL, stay.since_ns, inside)
    was_too_fast = stay.flags & TOO_FAST
    if _became_too_fast(stay, speed, zones.speed[z], now, continues, delay_ns):
        count = _note(changes, count, SPEED, stay.fast_ns, inside)
    elif was_too_fast and not stay.flags & TOO_FAST:
        count = _note(changes, count, SLOW, now, inside)
    return count


@njit(cache=True, nogil=True)
def _extent(modes: Any, low: Any, high: Any) -> float:
    """Set the box that holds NEAR standard deviations of every mode. Return the sum of the weights."""
    low[:], high[:] = np.inf, -np.inf
    total = 0.0
    for k in range(len(modes)):
        x, y = modes[k].x, modes[k].y
        reach_x, reach_y = NEAR * np.sqrt(modes[k].cov[0, 0]), NEAR * np.sqrt(modes[k].cov[1, 1])
        low[0], high[0] = min(low[0], x - reach_x), max(high[0], x + reach_x)
        low[1], high[1] = min(low[1], y - reach_y), max(high[1], y + reach_y)
        total += modes[k].weight
    return total


@njit(cache=True, nogil=True)
def _inside(modes: Any, box: Any, vertices: Any, first: int, end: int) -> float:
    """Return how much of the tag lies inside the polygon. Only edges that are near are integrated."""
    total = 0.0
    for k in range(len(modes)):
        x, y, cov = modes[k].x, modes[k].y, modes[k].cov
        half, turn = (cov[0, 0] + cov[1, 1]) / 2.0, (cov[0, 0] - cov[1, 1]) / 2.0
        reach = NEAR * np.sqrt(max(half + np.hypot(turn, cov[0, 1]), 0.0))
        if x + reach < box[0] or x - reach > box[2] or y + reach < box[1] or y - reach > box[3]:
            continue
        contains, distance2 = _place(x, y, vertices, first, end)
        if distance2 > reach * reach:
            total += modes[k].weight if contains else 0.0
        else:
            total += modes[k].weight * p_inside(x, y, cov, vertices, first, end)
    return total


@njit(cache=True, nogil=True)
def _place(x: float, y: float, vertices: Any, first: int, end: int) -> tuple[bool, float]:
    """Return whether the polygon contains the point, and the squared distance of the point from its edges."""
    contains, nearest = False, np.inf
    ax, ay = vertices[end - 1, 0] - x, vertices[end - 1, 1] - y
    for i in range(first, end):
        bx, by = vertices[i, 0] - x, vertices[i, 1] - y
        dx, dy = bx - ax, by - ay
        if (ay > 0.0) != (by > 0.0) and ax - ay * dx / dy > 0.0:
            contains = not contains
        t = min(max(-(ax * dx + ay * dy) / max(dx * dx + dy * dy, 1e-18), 0.0), 1.0)
        nearest = min(nearest, (ax + t * dx) ** 2 + (ay + t * dy) ** 2)
        ax, ay = bx, by
    return contains, nearest


@njit(cache=True, nogil=True)
def _turned(stay: Any, inside: float, outside: float, now: int, continues: bool, delay_ns: int) -> bool:
    """Return whether the tag has been on the other side for the delay. Note since when it is there."""
    if (outside < EXIT_P) if stay.flags & INSIDE else (inside < ENTER_P):
        stay.pending_ns = 0
        stay.seen_ns = now if stay.flags & INSIDE else 0
        return False
    if stay.pending_ns == 0 or not continues or stay.pending_ns > now:
        stay.pending_ns = now
    return bool(now - stay.pending_ns >= delay_ns)


@njit(cache=True, nogil=True)
def _became_too_fast(stay: Any, speed: float, limit: float, now: int, continues: bool, delay_ns: int) -> bool:
    """Return whether the tag has been faster than the limit for the delay, for the first time since it was slower."""
    if not speed > limit * (SLOWER if stay.flags & TOO_FAST else 1.0):
        stay.flags &= ~TOO_FAST & 0xFF
        stay.fast_ns = 0
        return False
    if stay.fast_ns == 0 or not continues or stay.fast_ns > now:
        stay.fast_ns = now
    if stay.flags & TOO_FAST or now - stay.fast_ns < delay_ns:
        return False
    stay.flags |= TOO_FAST
    return True


@njit(cache=True, nogil=True)
def _note(changes: Any, count: int, kind: int, since_ns: int, p: float) -> int:
    """Add a change, whose pose and zone the caller knows. Return the new number of changes."""
    changes[count].kind, changes[count].since_ns, changes[count].p = kind, since_ns, p
    return count + 1
