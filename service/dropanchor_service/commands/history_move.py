"""Copy the history of a site from its file into a database.

Before a stretch of time is copied, what the database has of it is compared with the file. So a copy that was stopped
goes on where it was, without a note of its own, and one that is complete changes nothing.
"""

import sqlite3
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from psycopg import Connection

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.postgresql.database import Database
from dropanchor_service.history.postgresql.writer import DatabaseWriter
from dropanchor_service.history.records import SLOT_NS, stored_poses
from dropanchor_service.history.sqlite.track_file import VERSION
from dropanchor_service.history.storage import Retention
from dropanchor_service.runtime.written_by import later_schema

POSES = 50_000  # about so many at once
MOST_SLOTS = 8640  # a day
SUMMARISE_S = 1.0  # at once

_SLOTS = "SELECT slot FROM slots WHERE slot > ? ORDER BY slot LIMIT ?"
_POSES = """
SELECT t_ns, pose, tags.name FROM slots CROSS JOIN poses USING (slot) JOIN tags ON tags.id = poses.tag
WHERE slots.slot BETWEEN ? AND ? ORDER BY poses.slot, poses.tag, t_ns
"""
_STORED = """
SELECT tags.name, count(DISTINCT t_ns) FROM poses JOIN tags ON tags.id = poses.tag JOIN sites ON sites.id = poses.site
WHERE sites.name = %s AND t_ns >= %s AND t_ns < %s GROUP BY tags.name
"""
_LIMITS = "SELECT keep_ns, max_bytes FROM sites WHERE name = %s"


@dataclass
class Moved:
    """What a copy has done: slots of ten seconds that it has looked at, poses that it has copied and found there."""

    slots: int = 0
    copied: int = 0
    present: int = 0


@dataclass(frozen=True)
class Part:
    """The poses of some consecutive slots. poses: POSE. tags, anchors: the names for each."""

    slots: list[int]
    poses: Array
    tags: list[str]
    anchors: list[str | None]


class HistoryFile:
    """The history in a file, which another process may be writing. Every method raises HistoryError."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with self._opened() as connection:
            try:
                version = connection.execute("PRAGMA user_version").fetchone()[0]
            except sqlite3.Error as error:
                raise HistoryError(f"{path} is no history: {error}") from error
            if version > VERSION:
                raise HistoryError(later_schema(path, version, VERSION, path))
            if version < 1:
                raise HistoryError(f"{path} is another kind of database")

    def count_slots(self) -> int:
        """Return how many slots have poses."""
        with self._opened() as connection:
            return int(connection.execute("SELECT count(*) FROM slots").fetchone()[0])

    def after(self, slot: int, slots: int) -> Part | None:
        """Return the poses of the next slots after one; None at the end."""
        with self._opened() as connection:
            connection.execute("BEGIN")  # one state of the file for all statements
            found = [number for (number,) in connection.execute(_SLOTS, (slot, slots))]
            if not found:
                return None
            rows = connection.execute(_POSES, (found[0], found[-1])).fetchall()
            anchors = dict(connection.execute("SELECT id, name FROM anchors").fetchall())
        stored = stored_poses([row[:2] for row in rows], anchors)
        return Part(found, stored.poses, [row[2] for row in rows], stored.anchors)

    def _opened(self) -> "closing[sqlite3.Connection]":
        try:
            return closing(sqlite3.connect(f"{self._path.absolute().as_uri()}?mode=ro", uri=True))
        except sqlite3.Error as error:
            raise HistoryError(f"{self._path} cannot be read: {error}") from error


def move(
    file: HistoryFile, database: Database, site: str, otherwise: Retention, tell: Callable[[Moved], None]
) -> Moved:
    """Copy what the database does not have yet, the oldest first. Return what was done. Raises HistoryError.

    otherwise: the limits of the site, if it has no history in the database yet. tell: called after every part.
    """
    writer = DatabaseWriter(database, site, _limits(database, site, otherwise))
    moved, slot, slots = Moved(), -(2**62), 6
    while (part := file.after(slot, slots)) is not None:
        if len(part.poses) and not _has(database, site, part):
            writer.insert(part.poses, part.tags, part.anchors)
            moved.copied += len(part.poses)
        else:
            moved.present += len(part.poses)
        moved.slots += len(part.slots)
        tell(moved)
        slot = part.slots[-1]
        slots = int(np.clip(POSES * len(part.slots) // max(1, len(part.poses)), 1, MOST_SLOTS))
    return moved


def summarise(database: Database, site: str, otherwise: Retention) -> bool:
    """Write summaries for a while. Return whether there are more to write. Raises HistoryError."""
    return DatabaseWriter(database, site, _limits(database, site, otherwise)).summarise(SUMMARISE_S)


def _has(database: Database, site: str, part: Part) -> bool:
    """Return whether the database has as many poses of each tag in this time as the file, or more."""
    from_ns, to_ns = part.slots[0] * SLOT_NS, (part.slots[-1] + 1) * SLOT_NS
    with database.reading() as connection:
        found = {} if connection is None else _counts(connection, site, from_ns, to_ns)
    return all(found.get(tag, 0) >= count for tag, count in Counter(part.tags).items())


def _counts(connection: Connection, site: str, from_ns: int, to_ns: int) -> dict[str, int]:
    return dict(connection.execute(_STORED, (site, from_ns, to_ns)).fetchall())


def _limits(database: Database, site: str, otherwise: Retention) -> Retention:
    """Return the limits that the site has in the database: those of its service hold."""
    with database.reading() as connection:
        found = None if connection is None else connection.execute(_LIMITS, (site,)).fetchone()
    if found is None:
        return otherwise
    return Retention(otherwise.period_ns, otherwise.distance_m, otherwise.still_ns, *found)
