"""Stored poses in a SQLite file, which one thread writes and any thread reads.

Rows are clustered by ten-second slot, then tag, then time. Poses that arrive together are therefore written together.
The oldest lie at the beginning, where deleting is cheap. Reading a track takes one seek per slot.
"""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.heat_cells import NO_HEAT
from dropanchor_service.history.heat_map import HeatMap, heat_map_of, read_heat_map
from dropanchor_service.history.overview import EMPTY, Overview, read_overview
from dropanchor_service.history.records import NO_POSES, SLOT_NS, StoredPoses, records_of, stored_poses
from dropanchor_service.history.summary_table import HEAT_SCHEMA, SummaryTable
from dropanchor_service.history.summary_table import SCHEMA as SUMMARY_SCHEMA

VERSION = 3  # 1: without summaries, 2: without heat
MAX_ROWS = 512  # per statement: sqlite3 releases the interpreter's lock in each one and must win it back
BUSY_S = 5.0

_SCHEMA = f"""
CREATE TABLE tags (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE anchors (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE slots (slot INTEGER PRIMARY KEY);
CREATE TABLE poses (
    slot INTEGER NOT NULL, tag INTEGER NOT NULL, t_ns INTEGER NOT NULL, pose BLOB NOT NULL,
    PRIMARY KEY (slot, tag, t_ns)
) WITHOUT ROWID;
{SUMMARY_SCHEMA}
{HEAT_SCHEMA}
PRAGMA user_version = {VERSION};
"""
_UPGRADES = {1: f"{SUMMARY_SCHEMA} {HEAT_SCHEMA}", 2: HEAT_SCHEMA}  # from each version
_FORWARD = """
SELECT t_ns, pose FROM slots CROSS JOIN poses USING (slot)
WHERE slots.slot BETWEEN ? AND ? AND tag = ? AND t_ns BETWEEN ? AND ? ORDER BY slots.slot, t_ns LIMIT ?
"""
_BACKWARD = _FORWARD.replace("slots.slot, t_ns", "slots.slot DESC, t_ns DESC")


class TrackFileError(sqlite3.Error):
    """The file has another schema version or is another kind of database."""


class TrackWriter:
    """The only connection that writes. Every method raises sqlite3.Error and then has changed nothing."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._connection = sqlite3.connect(path, BUSY_S, isolation_level=None, check_same_thread=False)
        try:
            self._prepare()
            self._summaries = SummaryTable(self._connection)
        except sqlite3.Error:
            self._connection.close()
            raise
        self._ids: dict[tuple[str, str], int] = {}

    def close(self) -> None:
        self._connection.close()

    def insert(self, poses: Array, tags: Sequence[str], anchors: Sequence[str | None]) -> None:
        """Insert poses, and replace poses of the same tag and time.

        poses: POSE. tags, anchors: the names for each pose.
        """
        with self._transaction():
            tag_ids = self._ids_of("tags", tags)
            anchor_ids = self._ids_of("anchors", anchors)
            order = np.lexsort((poses["t_ns"], tag_ids, poses["t_ns"] // SLOT_NS))
            slots = (poses["t_ns"] // SLOT_NS)[order]
            self._connection.executemany(
                "INSERT OR IGNORE INTO slots VALUES (?)", [(slot,) for slot in np.unique(slots).tolist()]
            )
            blobs = records_of(poses[order], anchor_ids[order])
            self._summaries.delete(slots)
            self._insert(slots.tolist(), tag_ids[order].tolist(), poses["t_ns"][order].tolist(), blobs)

    def prune(self, keep_from_ns: int, max_bytes: int) -> int:
        """Delete the oldest slot if it ends before `keep_from_ns` or the file exceeds `max_bytes`.

        Returns the number of deleted slots, 0 or 1.
        """
        oldest = self._connection.execute("SELECT min(slot) FROM slots").fetchone()[0]
        if oldest is None or ((oldest + 1) * SLOT_NS > keep_from_ns and self.used_bytes() <= max_bytes):
            return 0
        with self._transaction():
            self._connection.execute("DELETE FROM poses WHERE slot <= ?", (oldest,))
            self._connection.execute("DELETE FROM slots WHERE slot <= ?", (oldest,))
            self._summaries.prune(oldest)
        return 1

    def summarise(self) -> bool:
        """Write one missing summary, the newest first. Return whether there was one to write."""
        with self._transaction():
            return self._summaries.write_next()

    def used_bytes(self) -> int:
        """Return the size of the file without its free pages."""
        pages, free, size = (
            self._connection.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("page_count", "freelist_count", "page_size")
        )
        return int((pages - free) * size)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            self._ids.clear()  # some ids may belong to this transaction
            if self._connection.in_transaction:  # a full disk may have ended the transaction already
                self._connection.execute("ROLLBACK")
            raise

    def _prepare(self) -> None:
        version = self._connection.execute("PRAGMA user_version").fetchone()[0]
        tables = self._connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0]
        if version not in (0, *_UPGRADES, VERSION) or (version == 0 and tables):
            raise TrackFileError(
                f"the file has schema version {version}, but this service needs {VERSION}: move the file away"
            )
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._connection.execute("PRAGMA synchronous = NORMAL")
        self._connection.execute("PRAGMA journal_size_limit = 67108864")
        if version == 0:
            self._connection.executescript(f"BEGIN; {_SCHEMA} COMMIT;")
        elif version in _UPGRADES:
            upgrade = f"{_UPGRADES[version]} PRAGMA user_version = {VERSION};"
            self._connection.executescript(f"BEGIN; {upgrade} COMMIT;")

    def _insert(self, slots: list[int], tags: list[int], times: list[int], blobs: list[bytes]) -> None:
        flat = [value for row in zip(slots, tags, times, blobs, strict=True) for value in row]
        start = 0
        for rows in _powers(len(slots)):
            placeholders = ",".join(["(?,?,?,?)"] * rows)
            values = flat[start : start + 4 * rows]
            self._connection.execute(f"INSERT OR REPLACE INTO poses VALUES {placeholders}", values)
            start += len(values)

    def _ids_of(self, table: str, names: Sequence[str | None]) -> Array:
        """Return the ids of these names in the table `tags` or `anchors`, -1 for None. Add new names."""
        ids = {name: -1 if name is None else self._id(table, name) for name in set(names)}
        return np.array([ids[name] for name in names], np.int64)

    def _id(self, table: str, name: str) -> int:
        known = self._ids.get((table, name))
        if known is None:
            self._connection.execute(f"INSERT OR IGNORE INTO {table} (name) VALUES (?)", (name,))
            found = self._connection.execute(f"SELECT id FROM {table} WHERE name = ?", (name,)).fetchone()
            known = self._ids[table, name] = int(found[0])
        return known


class TrackReader:
    """Reads the file. It opens the file for every call, so that it holds no lock between calls."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def poses(self, tag: str, from_ns: int, to_ns: int, limit: int, newest_first: bool = False) -> StoredPoses:
        """Return up to `limit` poses between the two times, both included.

        Returns none when the file does not exist. Raises sqlite3.Error.
        """
        if not self._path.exists():
            return NO_POSES
        with self._connected() as connection:
            tag_id = _tag_id(connection, tag)
            sql = _BACKWARD if newest_first else _FORWARD
            window = (from_ns // SLOT_NS, to_ns // SLOT_NS, tag_id, from_ns, to_ns, limit)
            rows = connection.execute(sql, window).fetchall()
            names = dict(connection.execute("SELECT id, name FROM anchors"))
        return stored_poses(rows, names)

    def overview(self, tags: Sequence[str] | None, from_ns: int, to_ns: int, max_points: int) -> Overview:
        """Return the figures of these tags, or of all, and at most `max_points` points of each.

        Raises sqlite3.Error and TooMuchError.
        """
        if not self._path.exists():
            return EMPTY
        with self._connected() as connection:
            connection.execute("BEGIN")  # one state of the file for all statements
            return read_overview(connection, tags, from_ns, to_ns, max_points)

    def heat_map(self, tags: Sequence[str] | None, from_ns: int, to_ns: int, cell_m: float) -> HeatMap:
        """Return where these tags, or all, were, in squares of at least `cell_m`.

        Raises sqlite3.Error and TooMuchError.
        """
        if not self._path.exists():
            return heat_map_of(NO_HEAT, cell_m)
        with self._connected() as connection:
            connection.execute("BEGIN")
            return read_heat_map(connection, tags, from_ns, to_ns, cell_m)

    def tags(self) -> list[str]:
        """Return all tags of which the file ever held a pose. Raises sqlite3.Error."""
        if not self._path.exists():
            return []
        with self._connected() as connection:
            return [name for (name,) in connection.execute("SELECT name FROM tags")]

    def span(self) -> tuple[int, int] | None:
        """Return the time that the stored poses cover, ns; None without poses. Raises sqlite3.Error."""
        if not self._path.exists():
            return None
        with self._connected() as connection:
            oldest, newest = connection.execute("SELECT min(slot), max(slot) FROM slots").fetchone()
        return None if oldest is None else (oldest * SLOT_NS, (newest + 1) * SLOT_NS)

    def has_tag(self, tag: str) -> bool:
        """Return whether the file ever held a pose of this tag. Raises sqlite3.Error."""
        if not self._path.exists():
            return False
        with self._connected() as connection:
            return _tag_id(connection, tag) is not None

    def _connected(self) -> closing[sqlite3.Connection]:
        return closing(sqlite3.connect(f"{self._path.absolute().as_uri()}?mode=ro", BUSY_S, uri=True))


def _powers(count: int) -> Iterator[int]:
    """Yield powers of two, up to MAX_ROWS, that add up to `count`.

    The sqlite3 module caches 128 statements. One statement for every number of rows would take 20 MB.
    """
    while count:
        rows = min(MAX_ROWS, 1 << (count.bit_length() - 1))
        yield rows
        count -= rows


def _tag_id(connection: sqlite3.Connection, tag: str) -> int | None:
    found = connection.execute("SELECT id FROM tags WHERE name = ?", (tag,)).fetchone()
    return None if found is None else int(found[0])
