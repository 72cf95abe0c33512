"""Rows that made the engine fail again and again, whose samples are left out for a while."""

from typing import NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array

FAULTS_BEFORE_QUARANTINE = 3
QUARANTINE_NS = 10_000_000_000


class _Faults(NamedTuple):
    times: int
    until_ns: int


class Quarantine:
    """Owned by the ingest thread."""

    def __init__(self) -> None:
        self._faults: dict[int, _Faults] = {}

    def note(self, row: int, now_ns: int) -> None:
        """Note that a row made the engine fail."""
        times = self._faults.get(row, _Faults(0, 0)).times + 1
        is_due = times % FAULTS_BEFORE_QUARANTINE == 0
        self._faults[row] = _Faults(times, now_ns + QUARANTINE_NS if is_due else 0)

    def holds_any(self, now_ns: int) -> bool:
        """Return whether any row is in quarantine."""
        return any(faults.until_ns > now_ns for faults in self._faults.values())

    def holds(self, rows: Array, now_ns: int) -> Array:
        """Return which of the rows are in quarantine."""
        held = [row for row, faults in self._faults.items() if faults.until_ns > now_ns]
        return np.isin(rows, held) if held else np.zeros(len(rows), bool)
