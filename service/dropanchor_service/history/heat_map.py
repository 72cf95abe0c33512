"""Read for how long tags were where over a period of any length, as squares of one size."""

import math
import sqlite3
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.bulk_reading import summaries_of_poses
from dropanchor_service.history.covering import Cover, Window
from dropanchor_service.history.heat_cells import NO_HEAT, SIZES, SMALLEST_M, Heat, heat_in, heat_of_each, joined
from dropanchor_service.history.summary_table import DAY

MAX_SQUARES = 20_000
_MAX_AREA = 2**22  # squares of an area that are counted in one array; a larger area is mostly empty


@dataclass(frozen=True)
class HeatMap:
    """The time of all tags together in squares of one size.

    x, y: centres of the squares in m, in the frame of the site. left_out_s: when the tags were at no place of the map.
    """

    tags: int
    cell_m: float
    x: Array
    y: Array
    seconds: Array
    left_out_s: float


def read_heat_map(
    connection: sqlite3.Connection, tags: Sequence[str] | None, from_ns: int, to_ns: int, cell_m: float
) -> HeatMap:
    """Return where the tags, or all, were between two times, both included, in squares of at least `cell_m`.

    Raises sqlite3.Error and TooMuchError.
    """
    known = {name: number for number, name in connection.execute("SELECT id, name FROM tags")}
    wanted = None if tags is None else sorted(known[tag] for tag in set(tags) & known.keys())
    if wanted == [] or not known:
        return heat_map_of(NO_HEAT, cell_m)
    parts = _parts(connection, wanted, len(known if wanted is None else wanted), from_ns, to_ns)
    return heat_map_of(joined(list(parts)), cell_m)


def _parts(
    connection: sqlite3.Connection, tags: Sequence[int] | None, count: int, from_ns: int, to_ns: int
) -> Iterator[Heat]:
    for piece in Cover(connection, "heat", ("heads", "cells"), count).pieces(DAY, from_ns, to_ns):
        if isinstance(piece, Window):
            for poses in summaries_of_poses(connection, piece.from_ns, piece.to_ns, tags):
                yield heat_of_each(poses["tag"], poses["first"])
        else:
            yield heat_in(piece, tags)


def heat_map_of(heat: Heat, cell_m: float) -> HeatMap:
    """Return squares of at least `cell_m`: larger where the cells are larger, or for at most `MAX_SQUARES` of them."""
    size = max(_size(cell_m), int(heat.cells["size"].max(initial=0)))
    while True:
        x, y, seconds = _squares(heat.cells, size)
        if len(seconds) <= MAX_SQUARES:
            break
        size += 1
    side = SMALLEST_M * 2**size
    left_out_s = float(heat.heads["left_out_s"].sum())
    return HeatMap(len(heat.heads), side, (x + 0.5) * side, (y + 0.5) * side, seconds, left_out_s)


def _size(cell_m: float) -> int:
    return min(SIZES - 1, max(0, math.ceil(math.log2(cell_m / SMALLEST_M))))


def _squares(cells: Array, size: int) -> tuple[Array, Array, Array]:
    """Return column, line and seconds of each square of this size that holds any time."""
    if len(cells) == 0:
        return np.empty(0, np.int32), np.empty(0, np.int32), np.empty(0)
    shift = (size - cells["size"]).astype(np.int32)
    column, line = cells["x"].astype(np.int32) >> shift, cells["y"].astype(np.int32) >> shift
    left, bottom = int(column.min()), int(line.min())
    height = int(line.max()) - bottom + 1
    place = (column - left).astype(np.int64) * height + (line - bottom)
    if (int(column.max()) - left + 1) * height <= _MAX_AREA:
        total = np.bincount(place, cells["seconds"])
        squares = np.flatnonzero(total)
        return squares // height + left, squares % height + bottom, total[squares]
    squares, square_of = np.unique(place, return_inverse=True)
    return squares // height + left, squares % height + bottom, np.bincount(square_of, cells["seconds"])
