"""The last records of every row, in bounded memory."""

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.records import enlarged, put, take

FEWEST = 2  # records of a row, however many rows there are


class RowRings:
    """A ring per row, the oldest record overwritten first. Not locked: its owner is.

    The more rows there are the fewer records each keeps, so that all together stay within `most_bytes`.
    """

    def __init__(self, dtype: "np.dtype[np.void]", depth: int, most_bytes: int) -> None:
        """dtype: of a record, with its `row`."""
        self._most = depth
        self._most_bytes = most_bytes
        self._records: Array = np.zeros((depth, 0), dtype)  # place by place: a row that has few touches little memory
        self._counts = np.zeros(0, np.int64)

    def write(self, records: Array) -> None:
        """Per row in order."""
        if len(records) == 0:
            return
        rows = records["row"]
        self._grow(int(rows.max()) + 1)
        number = self._counts[rows] + rank_in_row(rows)
        put(self._records, (number % len(self._records), rows), records)
        self._counts[rows] = number + 1

    def of(self, row: int) -> Array:
        """A copy, oldest first."""
        if row >= len(self._counts):
            return np.zeros(0, self._records.dtype)
        count, depth = int(self._counts[row]), len(self._records)
        kept: Array = self._records[np.arange(max(0, count - depth), count) % depth, row]
        return kept

    def _grow(self, rows: int) -> None:
        if rows <= len(self._counts):
            return
        capacity = max(rows, 2 * len(self._counts))
        depth = max(FEWEST, min(self._most, self._most_bytes // (capacity * self._records.itemsize)))
        grown = np.zeros((depth, capacity), self._records.dtype)
        # The newest `depth` records of each row, numbered from the first that it ever had.
        number = self._counts[:, None] - depth + np.arange(depth)
        row, column = np.nonzero(number >= 0)
        kept = number[row, column]
        put(grown, (kept % depth, row), take(self._records, (kept % len(self._records), row)))
        self._records = grown
        self._counts = enlarged(self._counts, capacity)


def rank_in_row(rows: Array) -> Array:
    """How many entries of the same row stand before each entry."""
    if (rows[1:] >= rows[:-1]).all():
        return _rank_in_run(rows)
    order = np.argsort(rows, kind="stable")
    ranks = np.empty(len(rows), np.int64)
    ranks[order] = _rank_in_run(rows[order])
    return ranks


def _rank_in_run(rows: Array) -> Array:
    """The same for rows in ascending order."""
    starts = np.flatnonzero(np.append(True, rows[1:] != rows[:-1]))
    ranks: Array = np.arange(len(rows)) - np.repeat(starts, np.diff(starts, append=len(rows)))
    return ranks
