"""How long each tag was in each cell of a grid, so that a heat map of a month can be read without its poses.

Two neighbouring stretches of time have the cells of the whole: the sums of both, and the time from the last pose of the
one to the first pose of the other. A single pose is the heat of its instant. A cell is `SMALLEST_M` * 2**size wide, and
cells become larger where a tag was in too many.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.summaries import GAP_NS, is_placed
from dropanchor_service.store.records import take

SMALLEST_M = 0.5
SIZES = 12
LARGEST_M = SMALLEST_M * 2 ** (SIZES - 1)

HEAD = np.dtype(
    [
        *(("tag", "<u4"), ("first_ns", "<i8"), ("last_ns", "<i8"), ("x", "<f4"), ("y", "<f4")),  # x, y: the last pose
        ("placed", "u1"),  # whether that is a place of the map
        ("left_out_s", "<f4"),  # time at no place of the map
    ]
)
CELL = np.dtype([("tag", "<u4"), ("size", "u1"), ("x", "<i2"), ("y", "<i2"), ("seconds", "<f4")])


@dataclass(frozen=True)
class Heat:
    """heads: HEAD, one for each tag and stretch of time. cells: CELL."""

    heads: Array
    cells: Array


NO_HEAT = Heat(np.empty(0, HEAD), np.empty(0, CELL))


def heat_in(blobs: Sequence[tuple[bytes, ...]], tags: Sequence[int] | None) -> Heat:
    """Return what these pairs of blobs hold of the tags with these numbers; None: of all tags."""
    heads = np.frombuffer(b"".join([each[0] for each in blobs]), HEAD)
    cells = np.frombuffer(b"".join([each[1] for each in blobs]), CELL)
    if tags is None:
        return Heat(heads, cells)
    return Heat(take(heads, np.isin(heads["tag"], tags)), take(cells, np.isin(cells["tag"], tags)))


def heat_of_each(tags: Array, points: Array) -> Heat:
    """Return the heat of single poses. tags: number of the tag of each POINT."""
    heads = np.zeros(len(points), HEAD)
    heads["tag"], heads["first_ns"], heads["last_ns"] = tags, points["t_ns"], points["t_ns"]
    heads["x"], heads["y"], heads["placed"] = points["x"], points["y"], is_placed(points)
    return Heat(heads, NO_HEAT.cells)


def merged(parts: Sequence[Heat], max_cells: int) -> Heat:
    """Return the heat of disjoint stretches of time as one HEAD per tag, with at most `max_cells` cells per tag."""
    whole = joined(parts)
    return Heat(whole.heads, _fewer(whole.cells, max_cells))


def joined(parts: Sequence[Heat]) -> Heat:
    """Return the heat of disjoint stretches of time as one HEAD per tag, with several cells of a tag at one place."""
    heads = np.concatenate([part.heads for part in parts] or [NO_HEAT.heads])
    if len(heads) == 0:
        return NO_HEAT
    heads = take(heads, np.lexsort((heads["first_ns"], heads["tag"])))
    between, left_out_s = _between(heads)
    cells = np.concatenate([*(part.cells for part in parts), between])
    begins = np.append(True, heads["tag"][1:] != heads["tag"][:-1])
    starts = np.flatnonzero(begins)
    whole = take(heads, np.append(starts[1:], len(heads)) - 1)
    whole["first_ns"] = heads["first_ns"][starts]
    whole["left_out_s"] = np.add.reduceat(heads["left_out_s"] + left_out_s, starts)
    return Heat(whole, cells)


def _between(heads: Array) -> tuple[Array, Array]:
    """Return the CELLs of the time between the stretches of each tag, and the seconds before each HEAD without a place.

    A tag stays where it was until its next pose, unless that comes after `GAP_NS`.
    """
    end, elapsed_ns = heads[:-1], heads["first_ns"][1:] - heads["last_ns"][:-1]
    known = (heads["tag"][1:] == heads["tag"][:-1]) & (elapsed_ns <= GAP_NS)
    placed = known & (end["placed"] == 1) & _fits(end["x"]) & _fits(end["y"])
    cells = np.zeros(int(placed.sum()), CELL)
    cells["tag"], cells["seconds"] = end["tag"][placed], elapsed_ns[placed] * 1e-9
    for axis in ("x", "y"):
        cells[axis] = np.floor(end[axis][placed] / SMALLEST_M)
    return cells, np.append(0.0, np.where(known & ~placed, elapsed_ns * 1e-9, 0.0))


def _fits(values: Array) -> Array:
    """Return whether the number of the cell fits into its 16 bits: 16 km to each side."""
    fits: Array = np.abs(values) < SMALLEST_M * 2**15
    return fits


def _fewer(cells: Array, max_cells: int) -> Array:
    """Return the cells with their sums, larger ones for each tag that has more than `max_cells`."""
    cells = _summed(cells)
    for size in range(1, SIZES):
        tags, counts = np.unique(cells["tag"], return_counts=True)
        crowded = np.isin(cells["tag"], tags[counts > max_cells])
        if not crowded.any():
            break
        grow = crowded & (cells["size"] < size)
        larger = cells.copy()
        for axis in ("x", "y"):
            larger[axis][grow] >>= 1
        larger["size"][grow] = size
        cells = _summed(larger)
    return cells


def _summed(cells: Array) -> Array:
    """Return one CELL for each tag and place."""
    order = np.lexsort((cells["y"], cells["x"], cells["size"], cells["tag"]))
    ordered = take(cells, order)
    if len(ordered) == 0:
        return ordered
    differs = np.zeros(len(ordered) - 1, bool)
    for name in ("tag", "size", "x", "y"):
        differs |= ordered[name][1:] != ordered[name][:-1]
    starts = np.append(0, np.flatnonzero(differs) + 1)
    summed = take(ordered, starts)
    summed["seconds"] = np.add.reduceat(ordered["seconds"], starts)
    return summed
