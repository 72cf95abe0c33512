"""Ring buffers with the last records of every row, in bounded memory."""

from collections.abc import Collection

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.records import enlarged, narrow, put, take

MIN_DEPTH = 2  # records per row, however many rows there are
FEW = 128  # entries up to which a loop of Python is the faster one


class RowRings:
    """One ring buffer per row. Not thread-safe: its owner locks.

    The more rows there are, the fewer records each row keeps, so that all rows fit into `max_bytes`.
    """

    def __init__(self, dtype: "np.dtype[np.void]", max_depth: int, max_bytes: int, wide: Collection[str] = ()) -> None:
        """Create empty rings. dtype: of a record, with a field `row`; max_depth: records per row.

        wide: fields that keep all their digits; other float64 are kept as float32.
        """
        self._dtype = dtype
        self._max_depth = max_depth
        self._max_bytes = max_bytes
        self._records: Array = np.zeros(
            (max_depth, 0), narrow(dtype, wide)
        )  # (place in the ring, row): a row with few records touches little memory
        self._counts = np.zeros(0, np.int64)

    def write(self, records: Array) -> None:
        """Append records, which are in order per row."""
        if len(records) == 0:
            return
        rows = records["row"]
        self._grow(int(rows.max()) + 1)
        number = self._counts[rows] + rank_in_row(rows)
        put(self._records, (number % len(self._records), rows), records.astype(self._records.dtype))
        self._counts[rows] = number + 1

    def of(self, row: int) -> Array:
        """Return a copy of the row's records, the oldest first."""
        if row >= len(self._counts):
            return np.zeros(0, self._dtype)
        count, depth = int(self._counts[row]), len(self._records)
        kept: Array = self._records[np.arange(max(0, count - depth), count) % depth, row]
        return kept.astype(self._dtype)

    def _grow(self, rows: int) -> None:
        if rows <= len(self._counts):
            return
        capacity = max(rows, 2 * len(self._counts))
        depth = max(MIN_DEPTH, min(self._max_depth, self._max_bytes // (capacity * self._records.itemsize)))
        grown = np.zeros((depth, capacity), self._records.dtype)
        # Copy the newest `depth` records of each row. They are numbered from the first record the row ever had.
        number = self._counts[:, None] - depth + np.arange(depth)
        row, column = np.nonzero(number >= 0)
        kept = number[row, column]
        put(grown, (kept % depth, row), take(self._records, (kept % len(self._records), row)))
        self._records = grown
        self._counts = enlarged(self._counts, capacity)


def rank_in_row(rows: Array) -> Array:
    """Return how many entries of the same row stand before each entry."""
    if len(rows) <= FEW:
        return _rank_of_few(rows)
    if (rows[1:] >= rows[:-1]).all():
        return _rank_in_run(rows)
    order = np.argsort(rows, kind="stable")
    ranks = np.empty(len(rows), np.int64)
    ranks[order] = _rank_in_run(rows[order])
    return ranks


def _rank_of_few(rows: Array) -> Array:
    """Return `rank_in_row` without NumPy's cost of a call, which is most of that of a few entries."""
    found: dict[int, int] = {}
    ranks = []
    for row in rows.tolist():
        found[row] = rank = found.get(row, -1) + 1
        ranks.append(rank)
    return np.array(ranks, np.int64)


def _rank_in_run(rows: Array) -> Array:
    """Return `rank_in_row` of rows in ascending order."""
    starts = np.flatnonzero(np.append(True, rows[1:] != rows[:-1]))
    ranks: Array = np.arange(len(rows)) - np.repeat(starts, np.diff(starts, append=len(rows)))
    return ranks
