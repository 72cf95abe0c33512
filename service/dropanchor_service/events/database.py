"""The SQLite file of the events, the states behind them, and the queues of destinations.

One connection serves all threads, under a lock: every statement takes well under a millisecond, except the writing of a
storm of events.
"""

import logging
import sqlite3
import time
import weakref
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from threading import RLock
from typing import Any

from dropanchor_service.history.sqlite.damaged_file import is_damage, move_aside

FILE_NAME = "events.sqlite"
VERSION = 3
BUSY_S = 5.0

_STAYS = """
CREATE TABLE stays (tag TEXT NOT NULL, zone TEXT NOT NULL, entered_ns INTEGER NOT NULL, left_ns INTEGER NOT NULL);
CREATE INDEX stays_by_end ON stays (left_ns);
"""
_STAYS_OF_EVENTS = """
INSERT INTO stays SELECT tag, zone, entered_ns, since_ns FROM (
    SELECT tag, zone, type, since_ns, lag(type) OVER pairs AS before, lag(since_ns) OVER pairs AS entered_ns
    FROM (SELECT *, json_extract(body, '$.data.since_ns') AS since_ns FROM events)
    WHERE type IN ('dropanchor.zone.enter', 'dropanchor.zone.exit')
    WINDOW pairs AS (PARTITION BY tag, zone ORDER BY sequence)
) WHERE type = 'dropanchor.zone.exit' AND before = 'dropanchor.zone.enter';
"""
_SCHEMA = f"""
CREATE TABLE events (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT, type TEXT NOT NULL, tag TEXT NOT NULL, zone TEXT,
    t_ns INTEGER NOT NULL, body BLOB NOT NULL
);
CREATE INDEX events_of_tags ON events (tag, sequence);
CREATE TABLE states (
    source TEXT NOT NULL, item TEXT NOT NULL, tag TEXT NOT NULL, other TEXT NOT NULL,
    flags INTEGER NOT NULL, since_ns INTEGER NOT NULL,
    PRIMARY KEY (source, item, tag, other)
) WITHOUT ROWID;
CREATE TABLE deliveries (
    destination TEXT NOT NULL, sequence INTEGER NOT NULL, refusals INTEGER NOT NULL DEFAULT 0, dead TEXT,
    PRIMARY KEY (destination, sequence)
) WITHOUT ROWID;
{_STAYS}
PRAGMA user_version = {VERSION};
"""

_log = logging.getLogger(__name__)


class EventFileError(sqlite3.Error):
    """The file has another schema version or is another kind of database."""


class Database:
    """The open file, or a database in memory when there is no folder for it."""

    def __init__(self, folder: Path | None) -> None:
        """Open or make the file. A damaged file is moved aside. Raises sqlite3.Error or OSError."""
        self._lock = RLock()
        self._path = None if folder is None else folder / FILE_NAME
        try:
            self._connection = self._opened()
        except sqlite3.DatabaseError as error:
            if self._path is None or not is_damage(error):
                raise
            name = move_aside(self._path, time.strftime("%Y%m%dT%H%M%SZ", time.gmtime()))
            _log.error("%s is damaged (%s): it was renamed to %s and new events start", self._path, error, name)
            self._connection = self._opened()
        self._close = weakref.finalize(self, self._connection.close)

    def close(self) -> None:
        with self._lock:
            self._close()

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Write in this context, all or nothing. Raises sqlite3.Error."""
        with self._lock:
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:  # a full disk may have ended the transaction already
                    self._connection.execute("ROLLBACK")
                raise

    def rows(self, sql: str, *values: Any) -> list[tuple[Any, ...]]:
        """Return the rows of a query. Raises sqlite3.Error."""
        with self._lock:
            return self._connection.execute(sql, values).fetchall()

    def snapshot(self, *queries: tuple[str, Mapping[str, Any]]) -> list[list[tuple[Any, ...]]]:
        """Return the rows of several queries at one moment. Raises sqlite3.Error."""
        with self._lock:
            return [self._connection.execute(sql, values).fetchall() for sql, values in queries]

    def used_bytes(self) -> int:
        """Return the size of the file without its free pages."""
        pages, free, size = (
            self.rows(f"PRAGMA {name}")[0][0] for name in ("page_count", "freelist_count", "page_size")
        )
        return int((pages - free) * size)

    def _opened(self) -> sqlite3.Connection:
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
        connection = sqlite3.connect(self._path or ":memory:", BUSY_S, isolation_level=None, check_same_thread=False)
        try:
            self._prepare(connection)
        except sqlite3.Error:
            connection.close()
            raise
        return connection

    def _prepare(self, connection: sqlite3.Connection) -> None:
        version = connection.execute("PRAGMA user_version").fetchone()[0]
        tables = connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0]
        if version == 1:
            connection.executescript(
                "BEGIN; ALTER TABLE deliveries RENAME webhook TO destination; PRAGMA user_version = 2; COMMIT;"
            )
            version = 2
        if version == 2:
            connection.executescript(f"BEGIN; {_STAYS} {_STAYS_OF_EVENTS} PRAGMA user_version = 3; COMMIT;")
            version = VERSION
        if version not in (0, VERSION) or (version == 0 and tables):
            raise EventFileError(
                f"{self._path} has schema version {version}, but this service needs {VERSION}: move the file away"
            )
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")  # an event that was answered with survives a power failure
        connection.execute("PRAGMA journal_size_limit = 67108864")
        if version == 0:
            connection.executescript(f"BEGIN; {_SCHEMA} COMMIT;")
