"""The tables of summaries: for each stretch of two minutes, and of half an hour, one summary of every tag, and for
each of these and of a day the time of every tag in the cells of a grid.

A summary is missing from the moment when poses of its stretch are written until the stretch has rested for a write.
Nothing else says that it is missing, so a kill at any moment leaves no wrong summary behind.
"""

import sqlite3

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.bulk_reading import summaries_in, summaries_of_poses
from dropanchor_service.history.heat_cells import Heat, heat_in, heat_of_each, merged
from dropanchor_service.history.records import SLOT_NS
from dropanchor_service.history.summaries import SUMMARY, in_order, summary_per_tag

FINE, COARSE, DAY = LEVELS = 0, 1, 2
SLOTS = (12, 180, 8640)  # slots in a stretch of each level
LENGTHS_NS = tuple(slots * SLOT_NS for slots in SLOTS)
MAX_CELLS = (256, 384, 1024)  # of a tag in a stretch of each level

SCHEMA = """
CREATE TABLE summaries (
    level INTEGER NOT NULL, stretch INTEGER NOT NULL, tags BLOB NOT NULL, PRIMARY KEY (level, stretch)
);
"""
HEAT_SCHEMA = """
CREATE TABLE heat (
    level INTEGER NOT NULL, stretch INTEGER NOT NULL, heads BLOB NOT NULL, cells BLOB NOT NULL,
    PRIMARY KEY (level, stretch)
);
"""
_MISSING = "SELECT DISTINCT slot / ? FROM slots EXCEPT SELECT stretch FROM heat WHERE level = ?"


class SummaryTable:
    """Keeps the summaries. Its owner opens the transactions."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        """Find the missing summaries. Raises sqlite3.Error."""
        self._connection = connection
        self._missing = [self._find_missing(level) for level in LEVELS]
        self._newest = (connection.execute("SELECT max(slot) FROM slots").fetchone()[0] or 0) // SLOTS[FINE]
        self._resting = set(self._missing[FINE])

    def delete(self, slots: Array) -> None:
        """Delete the summaries of the stretches that contain these slots, to which poses are added."""
        touched = [np.unique(slots // length).tolist() for length in SLOTS]
        for level, stretches in enumerate(touched):
            self._delete(f"level = {level} AND stretch = ?", stretches)
            self._missing[level].update(stretches)
        self._newest = max(self._newest, *touched[FINE])
        self._resting = self._missing[FINE].difference(touched[FINE], (self._newest,))

    def prune(self, slot: int) -> None:
        """Delete the summaries of stretches that ended with this slot or before."""
        for level, length in enumerate(SLOTS):
            ended = (slot + 1) // length
            self._delete(f"level = {level} AND stretch < ?", [ended])
            self._missing[level] = {stretch for stretch in self._missing[level] if stretch >= ended}
        self._resting &= self._missing[FINE]

    def write_next(self) -> bool:
        """Write the newest missing summary of a stretch that rests, and return whether there was one.

        After it returned False, every stretch but the newest rests that no further poses are added to.
        Raises sqlite3.Error.
        """
        if self._resting:
            stretch = max(self._resting)
            self._write(FINE, stretch, *self._of_poses(stretch))
            self._resting.discard(stretch)
            return True
        for level in (COARSE, DAY):
            whole = {stretch for stretch in self._missing[level] if self._is_whole(level, stretch)}
            if whole:
                self._write(level, max(whole), *self._of_finer(level, max(whole)))
                return True
        self._resting = self._missing[FINE] - {self._newest}
        return False

    def _is_whole(self, level: int, stretch: int) -> bool:
        """Return whether the stretch is over, and no summary of the finer level is missing in it."""
        finer = _finer(level, stretch)
        is_over = (stretch + 1) * SLOTS[level] <= self._newest * SLOTS[FINE]
        return is_over and self._missing[level - 1].isdisjoint(finer)

    def _write(self, level: int, stretch: int, summaries: Array, heat: Heat) -> None:
        if level != DAY:
            sql = "INSERT OR REPLACE INTO summaries VALUES (?, ?, ?)"
            self._connection.execute(sql, (level, stretch, summaries.tobytes()))
        blobs = (heat.heads.tobytes(), heat.cells.tobytes())
        self._connection.execute("INSERT OR REPLACE INTO heat VALUES (?, ?, ?, ?)", (level, stretch, *blobs))
        self._missing[level].discard(stretch)

    def _delete(self, where: str, stretches: list[int]) -> None:
        for table in ("summaries", "heat"):
            self._connection.executemany(f"DELETE FROM {table} WHERE {where}", [(stretch,) for stretch in stretches])

    def _of_poses(self, fine: int) -> tuple[Array, Heat]:
        window = fine * LENGTHS_NS[FINE], (fine + 1) * LENGTHS_NS[FINE] - 1
        slots = list(summaries_of_poses(self._connection, *window, None))
        summaries = [summary_per_tag(in_order(each)) for each in slots]
        heat = merged([heat_of_each(each["tag"], each["first"]) for each in slots], MAX_CELLS[FINE])
        return summary_per_tag(in_order(np.concatenate([np.empty(0, SUMMARY), *summaries]))), heat

    def _of_finer(self, level: int, stretch: int) -> tuple[Array, Heat]:
        finer = _finer(level, stretch)
        window = (level - 1, finer.start, finer.stop - 1)
        where = "WHERE level = ? AND stretch BETWEEN ? AND ?"
        summaries = self._connection.execute(f"SELECT tags FROM summaries {where}", window).fetchall()
        heat = self._connection.execute(f"SELECT heads, cells FROM heat {where}", window).fetchall()
        whole = summary_per_tag(in_order(summaries_in([blob for (blob,) in summaries], None)))
        return whole, merged([heat_in(heat, None)], MAX_CELLS[level])

    def _find_missing(self, level: int) -> set[int]:
        return {stretch for (stretch,) in self._connection.execute(_MISSING, (SLOTS[level], level))}


def _finer(level: int, stretch: int) -> range:
    """Return the stretches of the next finer level in this one."""
    count = SLOTS[level] // SLOTS[level - 1]
    return range(stretch * count, (stretch + 1) * count)
