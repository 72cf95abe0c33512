"""Choose the points that the shape of a track needs most, and tell how far the others are from the line."""

import numpy as np

from dropanchor_service.estimation.columns import Array

PRECISE_M = 0.02  # no line needs to be closer


def by_shape(tags: Array, x: Array, y: Array, fixed: Array, most: int) -> Array:
    """Return which points to keep: at most `most` of each tag, all that are `fixed` among them.

    tags: ascending. In each round, stretches get the point that is farthest off their line: all that are at least half
    as far off as the worst of the tag (as Douglas and Peucker, Cartographica 10, 1973, do one by one).
    """
    kept, number = fixed.copy(), (tags - tags[0]).astype(np.int64)
    while True:
        places = np.flatnonzero(kept)
        off = off_the_line(x, y, places)
        ends = places[1:]
        farthest = np.maximum.reduceat(off, places[:-1] + 1) if len(ends) else np.empty(0)
        worst = np.zeros(number[-1] + 1)
        np.maximum.at(worst, number[ends], farthest)
        room = most - np.bincount(number[places], minlength=len(worst))
        wanted = np.flatnonzero(
            (farthest > PRECISE_M) & (farthest >= 0.5 * worst[number[ends]]) & (room[number[ends]] > 0)
        )
        wanted = wanted[np.lexsort((-farthest[wanted], number[ends[wanted]]))]
        of = number[ends[wanted]]
        wanted = wanted[np.arange(len(of)) - np.searchsorted(of, of) < room[of]]
        if not len(wanted):
            return kept
        stretch = np.repeat(np.arange(len(ends)), np.diff(places))
        is_farthest = off[places[0] + 1 : places[-1] + 1] >= farthest[stretch]
        found = np.flatnonzero(is_farthest & np.isin(stretch, wanted)) + places[0] + 1
        kept[found[np.append(True, np.diff(stretch[found - places[0] - 1]) > 0)]] = True


def off_the_line(x: Array, y: Array, kept: Array) -> Array:
    """Return how far each point is from the line between those before and after it that are kept, m; 0: unknown.

    kept: places of points, of which the first and the last are some.
    """
    place = np.arange(len(x))
    after = np.searchsorted(kept, place)
    start, end = kept[np.maximum(after - 1, 0)], kept[after]
    ax, ay, px, py = x[end] - x[start], y[end] - y[start], x - x[start], y - y[start]
    length = ax * ax + ay * ay
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.clip(np.where(length > 0.0, (px * ax + py * ay) / length, 0.0), 0.0, 1.0)
    off: Array = np.nan_to_num(np.hypot(px - share * ax, py - share * ay))
    return off
