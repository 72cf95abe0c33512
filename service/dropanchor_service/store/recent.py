"""What became of the last samples of tags of which some were rejected: how many arrived, and how many were not used."""

from typing import Final

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.records import enlarged

PERIOD_NS: Final = 5_000_000_000  # counts are of the last 5 to 10 s in which the tag sent something
FRESH_NS: Final = 3 * PERIOD_NS  # without a message for so long, they say nothing about now
COLUMNS: Final = ("messages", "samples", "screened", "unused", "rejected")
_NO_SLOT: Final = -1


class Recent:
    """Copies of the counters of single rows as they were 0 to 5 s and 5 to 10 s ago; the counters grow from them.

    A row has copies once one of its samples or messages was rejected: a tag without rejections costs 4 bytes. The
    copies have 16 bits, so that a difference is right up to 65,535.
    """

    def __init__(self, counts: "np.dtype[np.void]") -> None:
        copied = np.dtype([(name, ("u2", counts[name].shape)) for name in COLUMNS])
        self._slots = np.full(16, _NO_SLOT, np.int32)
        self._rows = 0
        self._copies = np.zeros((8, 2), copied)
        self._copied_ns = np.zeros(8, np.int64)

    def grow(self, rows: int) -> None:
        """Make room for this many rows."""
        missing = rows - len(self._slots)
        if missing > 0:
            self._slots = np.concatenate([self._slots, np.full(missing + len(self._slots), _NO_SLOT, np.int32)])

    def are_known(self, rows: Array) -> Array:
        """Return whether there are counts of each of these rows."""
        known: Array = self._slots[rows] != _NO_SLOT
        return known

    def forget(self) -> None:
        """Drop all copies, because the counters have changed."""
        self._slots[:] = _NO_SLOT
        self._rows = 0

    def drop(self, row: int) -> None:
        """Drop the copies of a row, because its counters are cleared."""
        self._slots[row] = _NO_SLOT

    def begin(self, rows: Array, counts: Array) -> None:
        """Copy the counters of rows that have no copies yet. counts: of all rows, before the first rejection."""
        new = rows[self._slots[rows] == _NO_SLOT]
        for row in sorted(set(new.tolist())):
            if self._rows == len(self._copies):
                self._copies = enlarged(self._copies, 2 * self._rows)
                self._copied_ns = enlarged(self._copied_ns, 2 * self._rows)
            self._copied_ns[self._rows] = counts["last_heard_ns"][row]
            for name in COLUMNS:
                self._copies[name][self._rows] = counts[name][row].astype(np.uint16)
            self._slots[row] = self._rows
            self._rows += 1

    def follow(self, rows: Array, counts: Array, now_ns: int) -> None:
        """Copy the counters of those of these rows, which have sent something, whose copies are old."""
        if not self._rows:
            return
        slots = self._slots[rows]
        of = np.unique(slots[slots != _NO_SLOT])
        of = of[now_ns - self._copied_ns[of] >= PERIOD_NS]
        if not len(of):
            return
        row_of = np.zeros(self._rows, np.int64)
        row_of[slots[slots != _NO_SLOT]] = rows[slots != _NO_SLOT]
        long_ago = now_ns - self._copied_ns[of] >= FRESH_NS
        for name in COLUMNS:
            now = counts[name][row_of[of]].astype(np.uint16)
            before = self._copies[name][of, 1]
            self._copies[name][of, 0] = np.where(long_ago.reshape(-1, *[1] * (now.ndim - 1)), now, before)
            self._copies[name][of, 1] = now
        self._copied_ns[of] = now_ns

    def of(self, rows: Array, counts: Array) -> dict[str, Array]:
        """Return by how much the counters of these rows, which are known, have grown in the last 5 to 10 s."""
        slots = self._slots[rows]
        return {name: counts[name][rows].astype(np.uint16) - self._copies[name][slots, 0] for name in COLUMNS}
