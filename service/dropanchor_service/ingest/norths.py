"""Ask the engine where north is, as the tracks that began with a told heading have learned it."""

from collections import deque

import numpy as np

from dropanchor_schemas.site import TagSettings
from dropanchor_service.estimation.north import LearnsNorth
from dropanchor_service.estimation.protocols import DeniesStarts, Engine
from dropanchor_service.store.norths import North, Norths

EVERY_NS = 1_000_000_000
AT_ONCE = 64  # rows: the engine waits meanwhile


class NorthWatch:
    """The rows that may know north, of which it looks at some every second. Owned by the ingest thread."""

    def __init__(self, engine: Engine, norths: Norths) -> None:
        """norths: receives what the rows tell."""
        self._engine = engine if isinstance(engine, LearnsNorth) else None
        self._starts = engine if isinstance(engine, DeniesStarts) else None
        self._norths = norths
        self._rows: deque[int] = deque()  # each once; the next one to look at stands first
        self._known: set[int] = set()
        self._looked_ns = 0

    def tell(self, row: int, tag: TagSettings) -> None:
        """Follow a row that starts with these settings, or goes on with them from a checkpoint."""
        self._norths.set(row, None)
        may_know = tag.start is not None and tag.start.heading_rad is not None and tag.heading_source != "platform"
        if self._engine is None or may_know == (row in self._known):
            return
        if may_know:
            self._known.add(row)
            self._rows.append(row)
        else:
            self._known.remove(row)
            self._rows.remove(row)

    def look(self, now_ns: int) -> None:
        """Ask about the next rows, unless that was done a moment ago."""
        if self._engine is None or not self._rows or abs(now_ns - self._looked_ns) < EVERY_NS:
            return
        self._looked_ns = now_ns
        rows = [self._rows[place] for place in range(min(AT_ONCE, len(self._rows)))]
        self._rows.rotate(-len(rows))
        found = self._engine.norths(np.array(rows, np.int64)).tolist()
        told = {row: North(declination, std) for row, declination, std in found}
        for row in rows:
            self._norths.set(row, told.get(row))

    def turns(self, row: int, declination: float) -> bool:
        """Return whether a row went on under another declination, rad, because its own track tells it north."""
        return self._engine is not None and self._engine.turn_north(row, declination)

    def has_left_start(self, row: int) -> bool:
        """Return whether the tag of a row is no longer known to be where its start leads."""
        return self._starts is not None and not self._starts.are_at_start(np.array([row]))[0]
