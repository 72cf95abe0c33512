"""Read for how long tags were where over a period of any length, as squares of one size."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.covering import Cover, Window
from dropanchor_service.history.heat_cells import NO_HEAT, SIZES, SMALLEST_M, Heat, heat_in, heat_of_each, joined
from dropanchor_service.history.stored import StoredTracks
from dropanchor_service.history.summary_table import DAY
from dropanchor_service.store.records import take

MAX_SQUARES = 20_000
_MAX_AREA = 2**22  # squares, also empty ones


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


def read_heat_map(stored: StoredTracks, tags: Sequence[str] | None, from_ns: int, to_ns: int, cell_m: float) -> HeatMap:
    """Return where the tags, or all, were between two times, both included, in squares of at least `cell_m`.

    Raises the errors of `StoredTracks` and TooMuchError.
    """
    known = {name: number for number, name in stored.tag_names().items()}
    wanted = None if tags is None else sorted(known[tag] for tag in set(tags) & known.keys())
    if wanted == [] or not known:
        return heat_map_of(NO_HEAT, cell_m)
    parts = _parts(stored, wanted, len(known if wanted is None else wanted), from_ns, to_ns)
    return heat_map_of(joined(list(parts)), cell_m)


def _parts(stored: StoredTracks, tags: Sequence[int] | None, count: int, from_ns: int, to_ns: int) -> Iterator[Heat]:
    for piece in Cover(stored, "heat", count).pieces(DAY, from_ns, to_ns):
        if isinstance(piece, Window):
            for poses in stored.summaries_of_poses(piece.from_ns, piece.to_ns, tags):
                yield heat_of_each(poses["tag"], poses["first"])
        else:
            yield heat_in(piece, tags)


def heat_map_of(heat: Heat, cell_m: float) -> HeatMap:
    """Return squares of at least `cell_m`: larger ones where there would be more than `MAX_SQUARES`, or a wide area."""
    size = min(SIZES - 1, max(0, math.ceil(math.log2(cell_m / SMALLEST_M))))
    while True:
        area = _Area(heat.cells, size)
        if area.width * area.height <= _MAX_AREA:
            total = area.seconds(heat.cells)
            squares = np.flatnonzero(total)
            if len(squares) <= MAX_SQUARES:
                break
        size += 1
    side, left_out_s = SMALLEST_M * 2**size, float(heat.heads["left_out_s"].sum())
    column, line = np.divmod(squares, area.height)
    x, y = (column + area.left + 0.5) * side, (line + area.bottom + 0.5) * side
    return HeatMap(len(heat.heads), side, x, y, total.ravel()[squares], left_out_s)


class _Area:
    """The squares of one size around some CELLs. Whole cells of every size fit into it."""

    def __init__(self, cells: Array, size: int) -> None:
        self._size = size
        largest = max(size, int(cells["size"].max(initial=0)))
        self.left, self.width = self._span(cells, "x", largest)
        self.bottom, self.height = self._span(cells, "y", largest)

    def _span(self, cells: Array, axis: str, largest: int) -> tuple[int, int]:
        """Return the number of the first square on this axis, and how many there are."""
        if len(cells) == 0:
            return 0, 0
        numbers = cells[axis].astype(np.int32) >> (largest - cells["size"]).astype(np.int32)
        first, last = int(numbers.min()), int(numbers.max())
        return first << (largest - self._size), (last - first + 1) << (largest - self._size)

    def seconds(self, cells: Array) -> Array:
        """Return the time in each square. That of a cell which is larger than a square is spread over its squares."""
        total = np.zeros((self.width, self.height))
        for size in np.unique(cells["size"]).tolist():
            some = take(cells, cells["size"] == size)
            split = 2 ** max(0, size - self._size)
            merge = max(0, self._size - size)
            column = (some["x"].astype(np.int32) >> merge) - self.left // split
            line = (some["y"].astype(np.int32) >> merge) - self.bottom // split
            shape = self.width // split, self.height // split
            each = np.bincount(column * shape[1] + line, some["seconds"], shape[0] * shape[1]).reshape(shape)
            total += np.repeat(np.repeat(each, split, 0), split, 1) / split**2
        return total
