"""Which summaries are written when: for each stretch of two minutes, and of half an hour, one summary of every tag, and
for each of these and of a day the time of every tag in the cells of a grid.

A summary is missing from the moment when poses of its stretch are written until the stretch has rested for a write.
One transaction adds the poses and deletes it, so a kill at any moment leaves no wrong summary behind.
"""

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.heat_cells import Heat, heat_in, heat_of_each, merged
from dropanchor_service.history.records import SLOT_NS
from dropanchor_service.history.stored import WritableTracks
from dropanchor_service.history.summaries import SUMMARY, in_order, summaries_in, summary_per_tag

FINE, COARSE, DAY = LEVELS = 0, 1, 2
SLOTS = (12, 180, 8640)  # slots in a stretch of each level
LENGTHS_NS = tuple(slots * SLOT_NS for slots in SLOTS)
MAX_CELLS = (256, 384, 1024)  # of a tag in a stretch of each level


class SummaryTable:
    """Keeps the summaries of a site. Its owner opens the transactions, and passes what is stored to each method."""

    def __init__(self, stored: WritableTracks) -> None:
        """Find the missing summaries."""
        self._resting: set[int] = set()
        self.reload(stored)
        self._resting = set(self._missing[FINE])

    def reload(self, stored: WritableTracks) -> None:
        """Find the missing summaries again, where another process may write too."""
        self._missing = [stored.missing_stretches(level) for level in LEVELS]
        self._newest = (stored.newest_slot() or 0) // SLOTS[FINE]
        self._resting &= self._missing[FINE]

    def delete(self, stored: WritableTracks, slots: Array) -> None:
        """Delete the summaries of the stretches that contain these slots, to which poses are added."""
        touched = [np.unique(slots // length).tolist() for length in SLOTS]
        for level, stretches in enumerate(touched):
            if written := [stretch for stretch in stretches if stretch not in self._missing[level]]:
                stored.delete_stretches(level, written)
            self._missing[level].update(stretches)
        self._newest = max(self._newest, *touched[FINE])
        self._resting = self._missing[FINE].difference(touched[FINE], (self._newest,))

    def forget(self, level: int, before: int) -> None:
        """Forget the stretches before this one, which are deleted."""
        self._missing[level] = {stretch for stretch in self._missing[level] if stretch >= before}
        self._resting &= self._missing[FINE]

    def write_next(self, stored: WritableTracks) -> bool:
        """Write the newest missing summary of a stretch that rests, and return whether there was one; see `next`."""
        if (found := self.next()) is None:
            return False
        self.write(stored, *found)
        return True

    def next(self) -> tuple[int, int] | None:
        """Return level and stretch of the newest missing summary of a stretch that rests; None if there is none.

        After it returned None, every stretch but the newest rests that no further poses are added to.
        """
        if self._resting:
            return FINE, max(self._resting)
        for level in (COARSE, DAY):
            whole = {stretch for stretch in self._missing[level] if self._is_whole(level, stretch)}
            if whole:
                return level, max(whole)
        self._resting = self._missing[FINE] - {self._newest}
        return None

    def write(self, stored: WritableTracks, level: int, stretch: int) -> None:
        """Write the summary that `next` has returned."""
        summaries, heat = _of_poses(stored, stretch) if level == FINE else _of_finer(stored, level, stretch)
        blob = None if level == DAY else summaries.tobytes()
        stored.put_stretch(level, stretch, blob, heat.heads.tobytes(), heat.cells.tobytes())
        self._missing[level].discard(stretch)
        if level == FINE:
            self._resting.discard(stretch)

    def _is_whole(self, level: int, stretch: int) -> bool:
        """Return whether the stretch is over, and no summary of the finer level is missing in it."""
        finer = _finer(level, stretch)
        is_over = (stretch + 1) * SLOTS[level] <= self._newest * SLOTS[FINE]
        return is_over and self._missing[level - 1].isdisjoint(finer)


def _of_poses(stored: WritableTracks, fine: int) -> tuple[Array, Heat]:
    window = fine * LENGTHS_NS[FINE], (fine + 1) * LENGTHS_NS[FINE] - 1
    slots = list(stored.summaries_of_poses(*window, None))
    summaries = [summary_per_tag(in_order(each)) for each in slots]
    heat = merged([heat_of_each(each["tag"], each["first"]) for each in slots], MAX_CELLS[FINE])
    return summary_per_tag(in_order(np.concatenate([np.empty(0, SUMMARY), *summaries]))), heat


def _of_finer(stored: WritableTracks, level: int, stretch: int) -> tuple[Array, Heat]:
    finer = _finer(level, stretch)
    summaries = [blob for (blob,) in stored.stretches("summaries", level - 1, finer).values()]
    heat = heat_in(list(stored.stretches("heat", level - 1, finer).values()), None)
    return summary_per_tag(in_order(summaries_in(summaries, None))), merged([heat], MAX_CELLS[level])


def _finer(level: int, stretch: int) -> range:
    """Return the stretches of the next finer level in this one."""
    count = SLOTS[level] // SLOTS[level - 1]
    return range(stretch * count, (stretch + 1) * count)
