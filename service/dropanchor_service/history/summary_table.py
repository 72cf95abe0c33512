"""The table of summaries: for each stretch of two minutes, and of half an hour, one summary of every tag.

A summary is missing from the moment when poses of its stretch are written until the stretch has rested for a write.
Nothing else says that it is missing, so a kill at any moment leaves no wrong summary behind.
"""

import sqlite3

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.bulk_reading import summaries_in, summaries_of_poses
from dropanchor_service.history.records import SLOT_NS
from dropanchor_service.history.summaries import SUMMARY, in_order, summary_per_tag

FINE, COARSE = 0, 1
SLOTS = (12, 180)  # slots in a stretch of each level
LENGTHS_NS = tuple(slots * SLOT_NS for slots in SLOTS)
_FINE_PER_COARSE = SLOTS[COARSE] // SLOTS[FINE]

SCHEMA = """
CREATE TABLE summaries (
    level INTEGER NOT NULL, stretch INTEGER NOT NULL, tags BLOB NOT NULL, PRIMARY KEY (level, stretch)
);
"""
_MISSING = "SELECT DISTINCT slot / ? FROM slots EXCEPT SELECT stretch FROM summaries WHERE level = ?"


class SummaryTable:
    """Keeps the summaries. Its owner opens the transactions."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        """Find the missing summaries. Raises sqlite3.Error."""
        self._connection = connection
        self._missing = [self._find_missing(level) for level in (FINE, COARSE)]
        self._newest = (connection.execute("SELECT max(slot) FROM slots").fetchone()[0] or 0) // SLOTS[FINE]
        self._resting = set(self._missing[FINE])

    def delete(self, slots: Array) -> None:
        """Delete the summaries of the stretches that contain these slots, to which poses are added."""
        touched = [np.unique(slots // length).tolist() for length in SLOTS]
        for level, stretches in enumerate(touched):
            self._connection.executemany(
                f"DELETE FROM summaries WHERE level = {level} AND stretch = ?", [(stretch,) for stretch in stretches]
            )
            self._missing[level].update(stretches)
        self._newest = max(self._newest, *touched[FINE])
        self._resting = self._missing[FINE].difference(touched[FINE], (self._newest,))

    def prune(self, slot: int) -> None:
        """Delete the summaries of stretches that ended with this slot or before."""
        for level, length in enumerate(SLOTS):
            ended = (slot + 1) // length
            self._connection.execute("DELETE FROM summaries WHERE level = ? AND stretch < ?", (level, ended))
            self._missing[level] = {stretch for stretch in self._missing[level] if stretch >= ended}
        self._resting &= self._missing[FINE]

    def write_next(self) -> bool:
        """Write the newest missing summary of a stretch that rests, and return whether there was one.

        After it returned False, every stretch but the newest rests that no further poses are added to.
        Raises sqlite3.Error.
        """
        if self._resting:
            stretch = max(self._resting)
            self._write(FINE, stretch, self._of_poses(stretch))
            self._resting.discard(stretch)
            return True
        whole = {stretch for stretch in self._missing[COARSE] if self._is_whole(stretch)}
        if not whole:
            self._resting = self._missing[FINE] - {self._newest}
            return False
        self._write(COARSE, max(whole), self._of_fine(max(whole)))
        return True

    def _is_whole(self, coarse: int) -> bool:
        first = coarse * _FINE_PER_COARSE
        return first + _FINE_PER_COARSE <= self._newest and self._missing[FINE].isdisjoint(
            range(first, first + _FINE_PER_COARSE)
        )

    def _write(self, level: int, stretch: int, summaries: Array) -> None:
        self._connection.execute(
            "INSERT OR REPLACE INTO summaries VALUES (?, ?, ?)", (level, stretch, summaries.tobytes())
        )
        self._missing[level].discard(stretch)

    def _of_poses(self, fine: int) -> Array:
        window = fine * LENGTHS_NS[FINE], (fine + 1) * LENGTHS_NS[FINE] - 1
        slots = [summary_per_tag(in_order(each)) for each in summaries_of_poses(self._connection, *window, None)]
        return summary_per_tag(in_order(np.concatenate([np.empty(0, SUMMARY), *slots])))

    def _of_fine(self, coarse: int) -> Array:
        first = coarse * _FINE_PER_COARSE
        rows = self._connection.execute(
            f"SELECT tags FROM summaries WHERE level = {FINE} AND stretch BETWEEN ? AND ?",
            (first, first + _FINE_PER_COARSE - 1),
        )
        return summary_per_tag(in_order(summaries_in([blob for (blob,) in rows], None)))

    def _find_missing(self, level: int) -> set[int]:
        return {stretch for (stretch,) in self._connection.execute(_MISSING, (SLOTS[level], level))}
