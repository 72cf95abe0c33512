"""The last records of every row, in bounded memory."""

import numpy as np

from dropanchor_service.estimation.batch import Array

FEWEST = 2  # records of a row, however many rows there are


class RowRings:
    """A ring per row, the oldest record overwritten first. Not locked: its owner is.

    The more rows there are the fewer records each keeps, so that all together stay within `most_bytes`.
    """

    def __init__(self, dtype: "np.dtype[np.void]", depth: int, most_bytes: int) -> None:
        """dtype: of a record, with its `row`."""
        self._most = depth
        self._most_bytes = most_bytes
        self._records: Array = np.zeros((0, depth), dtype)
        self._counts = np.zeros(0, np.int64)

    def write(self, records: Array) -> None:
        """Per row in order."""
        if len(records) == 0:
            return
        rows = records["row"]
        self._grow(int(rows.max()) + 1)
        place = (self._counts[rows] + _rank_in_row(rows)) % self._records.shape[1]
        # With repeated indices NumPy keeps the last assignment, which is the newest record.
        self._records[rows, place] = records
        np.add.at(self._counts, rows, 1)

    def of(self, row: int) -> Array:
        """A copy, oldest first."""
        if row >= len(self._counts):
            return self._records[:0, 0].copy()
        count, depth = int(self._counts[row]), self._records.shape[1]
        kept: Array = self._records[row, np.arange(max(0, count - depth), count) % depth]
        return kept

    def _grow(self, rows: int) -> None:
        if rows <= len(self._counts):
            return
        capacity = max(rows, 2 * len(self._counts))
        depth = max(FEWEST, min(self._most, self._most_bytes // (capacity * self._records.itemsize)))
        grown = np.zeros((capacity, depth), self._records.dtype)
        # The newest `depth` records of each row, numbered from the first that it ever had.
        number = self._counts[:, None] - depth + np.arange(depth)
        row, column = np.nonzero(number >= 0)
        kept = number[row, column]
        grown[row, kept % depth] = self._records[row, kept % self._records.shape[1]]
        self._records = grown
        self._counts = np.concatenate([self._counts, np.zeros(capacity - len(self._counts), np.int64)])


def _rank_in_row(rows: Array) -> Array:
    """How many entries of the same row stand before each entry."""
    order = np.argsort(rows, kind="stable")
    ordered = rows[order]
    first = np.append(True, ordered[1:] != ordered[:-1])
    starts = np.flatnonzero(first)
    ranks = np.empty(len(rows), np.int64)
    ranks[order] = np.arange(len(rows)) - np.repeat(starts, np.diff(np.append(starts, len(rows))))
    return ranks
