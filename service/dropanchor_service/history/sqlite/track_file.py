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
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.reader import TrackReader
from dropanchor_service.history.records import SLOT_NS, records_of
from dropanchor_service.history.sqlite.damaged_file import is_damage
from dropanchor_service.history.sqlite.rows import SqliteRows
from dropanchor_service.history.summary_table import SLOTS, SummaryTable
from dropanchor_service.runtime.written_by import later_schema

VERSION = 4
WITHOUT_HEIGHTS = 3  # the first that was released
MAX_ROWS = 512  # per statement: sqlite3 releases the interpreter's lock in each one and must win it back
BUSY_S = 5.0

_SUMMARIES = """
CREATE TABLE summaries (
    level INTEGER NOT NULL, stretch INTEGER NOT NULL, tags BLOB NOT NULL, PRIMARY KEY (level, stretch)
);
CREATE TABLE heat (
    level INTEGER NOT NULL, stretch INTEGER NOT NULL, heads BLOB NOT NULL, cells BLOB NOT NULL,
    PRIMARY KEY (level, stretch)
);
"""
_SCHEMA = f"""
CREATE TABLE tags (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE anchors (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE slots (slot INTEGER PRIMARY KEY);
CREATE TABLE poses (
    slot INTEGER NOT NULL, tag INTEGER NOT NULL, t_ns INTEGER NOT NULL, pose BLOB NOT NULL,
    PRIMARY KEY (slot, tag, t_ns)
) WITHOUT ROWID;
{_SUMMARIES}
PRAGMA user_version = {VERSION};
"""
_ADD_HEIGHTS = f"DROP TABLE summaries; DROP TABLE heat; {_SUMMARIES}"
"""What is missing is summarised again."""
_USED = """
SELECT (page_count - freelist_count) * page_size FROM pragma_page_count, pragma_freelist_count, pragma_page_size
"""


class TrackFileError(sqlite3.Error):
    """The file is of a later version, or another kind of database."""


class TrackWriter:
    """The only connection that writes. Every method raises sqlite3.Error and then has changed nothing."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._path = path
        self._connection = sqlite3.connect(path, BUSY_S, isolation_level=None, check_same_thread=False)
        try:
            self._prepare()
            self._rows = SqliteRows(self._connection)
            self._known_summaries: SummaryTable | None = SummaryTable(self._rows)
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
            self._summaries().delete(self._rows, slots)
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
            for level, length in enumerate(SLOTS):  # the stretches that ended with this slot or before
                self._rows.delete_stretches_before(level, (oldest + 1) // length)
                self._summaries().forget(level, (oldest + 1) // length)
        return 1

    def summarise(self) -> bool:
        """Write one missing summary, the newest first. Return whether there was one to write."""
        found = self._summaries().next()
        if found is None:  # as nearly always: then a transaction would be most of the cost of a write
            return False
        with self._transaction():
            self._summaries().write(self._rows, *found)
        return True

    def used_bytes(self) -> int:
        """Return the size of the file without its free pages."""
        return int(self._connection.execute(_USED).fetchone()[0])

    def _summaries(self) -> SummaryTable:
        if self._known_summaries is None:
            self._known_summaries = SummaryTable(self._rows)
        return self._known_summaries

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            self._ids.clear()  # some ids may belong to this transaction
            self._known_summaries = None  # and so may deletions
            if self._connection.in_transaction:  # a full disk may have ended the transaction already
                self._connection.execute("ROLLBACK")
            raise

    def _prepare(self) -> None:
        version = self._connection.execute("PRAGMA user_version").fetchone()[0]
        tables = self._connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0]
        if version > VERSION:
            raise TrackFileError(later_schema(self._path.name, version, VERSION, self._path))
        if version < WITHOUT_HEIGHTS and tables:
            raise TrackFileError(f"{self._path.name} is another kind of database: move the file away")
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._connection.execute("PRAGMA synchronous = NORMAL")
        self._connection.execute("PRAGMA journal_size_limit = 67108864")
        if version == 0:
            self._connection.executescript(f"BEGIN; {_SCHEMA} COMMIT;")
        elif version == WITHOUT_HEIGHTS:
            self._connection.executescript(f"BEGIN; {_ADD_HEIGHTS} PRAGMA user_version = {VERSION}; COMMIT;")

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


class FileReader(TrackReader):
    """Reads the file. It opens the file for every snapshot, so that it holds no lock between them."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.has_found_damage = False

    @contextmanager
    def snapshot(self) -> Iterator[SqliteRows | None]:
        """Return the tracks at this moment; None while there is no file with tables. Raises HistoryError."""
        if not self._path.exists():
            yield None
            return
        try:
            uri = f"{self._path.absolute().as_uri()}?mode=ro"
            with closing(sqlite3.connect(uri, BUSY_S, uri=True)) as connection:
                connection.execute("BEGIN")  # one state of the file for all statements
                is_made = connection.execute("SELECT EXISTS (SELECT 1 FROM sqlite_schema)").fetchone()[0]
                yield SqliteRows(connection) if is_made else None
        except sqlite3.Error as error:
            self.has_found_damage |= is_damage(error)
            raise HistoryError(str(error)) from error


def _powers(count: int) -> Iterator[int]:
    """Yield powers of two, up to MAX_ROWS, that add up to `count`.

    The sqlite3 module caches 128 statements. One statement for every number of rows would take 20 MB.
    """
    while count:
        rows = min(MAX_ROWS, 1 << (count.bit_length() - 1))
        yield rows
        count -= rows
