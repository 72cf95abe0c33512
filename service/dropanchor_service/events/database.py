"""The SQLite file of the events, the states behind them, the queues of destinations, and the trail of changes.

One connection serves all threads, under a lock: every statement takes well under a millisecond, except the writing of a
storm of events.
"""

import sqlite3
import weakref
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from threading import RLock
from typing import Any

from dropanchor_schemas.sentences import said_by, say
from dropanchor_service.history.sqlite.damaged_file import damage_in, is_damage
from dropanchor_service.runtime.recovery import Recovery, damaged
from dropanchor_service.runtime.written_by import later_schema

FILE_NAME = "events.sqlite"
VERSION = 7
BUSY_S = 5.0
CHECK_S = 1.0  # at a start: a large file is checked in part
INSTEAD = say("new_events", "new events start, and what waited for its destinations is lost")

_STARTS = """
CREATE TABLE starts (
    tag TEXT PRIMARY KEY, place TEXT NOT NULL, before TEXT NOT NULL, first INTEGER NOT NULL, since_ns INTEGER NOT NULL,
    inside TEXT NOT NULL
) WITHOUT ROWID;
"""
_CHANGES = """
CREATE TABLE changes (
    number INTEGER PRIMARY KEY AUTOINCREMENT, t_ns INTEGER NOT NULL, source TEXT NOT NULL, name TEXT NOT NULL,
    kind TEXT NOT NULL, item TEXT NOT NULL, before TEXT, after TEXT, confirmed INTEGER NOT NULL DEFAULT 0
);
CREATE INDEX changes_by_time ON changes (t_ns);
"""
_ALARMS = """
CREATE TABLE alarms (
    sequence INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, source TEXT NOT NULL, item TEXT NOT NULL, tag TEXT NOT NULL,
    other TEXT NOT NULL, flag INTEGER NOT NULL, severity TEXT NOT NULL, over_ns INTEGER, acknowledged TEXT,
    body BLOB NOT NULL
);
CREATE INDEX open_alarms ON alarms (source, item, tag, other) WHERE over_ns IS NULL;
CREATE INDEX current_alarms ON alarms (sequence) WHERE over_ns IS NULL OR acknowledged IS NULL;
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
    again_ns INTEGER,
    PRIMARY KEY (destination, sequence)
) WITHOUT ROWID;
CREATE INDEX dead_letters ON deliveries (destination, again_ns) WHERE dead IS NOT NULL;
CREATE TABLE stays (tag TEXT NOT NULL, zone TEXT NOT NULL, entered_ns INTEGER NOT NULL, left_ns INTEGER NOT NULL);
CREATE INDEX stays_by_end ON stays (left_ns);
{_STARTS}
{_CHANGES}
{_ALARMS}
PRAGMA user_version = {VERSION};
"""


_STEPS = (
    _STARTS,
    _CHANGES,
    _ALARMS,
)
"""From each version to the next one."""
_RELEASED = VERSION - len(_STEPS)  # first


class EventFileError(sqlite3.Error):
    """The file is of a later version, or another kind of database."""


class Database:
    """The open file, or a database in memory when there is no folder for it.

    It is made when it is first used: many sites have no events, and an open file takes memory and three descriptors.
    """

    def __init__(self, folder: Path | None, recovery: Recovery | None = None) -> None:
        """Open the file if there is one. A damaged one is set aside, and `recovery` reports it.

        Raises EventFileError.
        """
        self._recovery = recovery or Recovery()
        self._lock = RLock()
        self._path = None if folder is None else folder / FILE_NAME
        self._open: sqlite3.Connection | None = None
        if self._path is not None:
            self._open_checked(self._path)

    def _open_checked(self, path: Path) -> None:
        """Open the file if there is one. Where it cannot be, the first event tries again."""
        if (why := damage_in(path, CHECK_S)) is not None:
            self._recovery.set_aside(path, why, INSTEAD)
        if path.exists():
            try:
                self._connection()
            except sqlite3.OperationalError as error:
                self._recovery.note(
                    say(
                        "file_unopened",
                        "{file} cannot be opened ({why}): start the service again when it can be",
                        file=path.name,
                        why=said_by(error),
                    )
                )

    @property
    def is_made(self) -> bool:
        """Whether it has been used, so that it may hold something."""
        return self._open is not None

    def close(self) -> None:
        with self._lock:
            if self._open is not None:
                self._open.close()

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Write in this context, all or nothing. Raises sqlite3.Error."""
        with self._lock:
            connection = self._connection()
            connection.execute("BEGIN IMMEDIATE")
            try:
                yield connection
                connection.execute("COMMIT")
            except BaseException:
                if connection.in_transaction:  # a full disk may have ended the transaction already
                    connection.execute("ROLLBACK")
                raise

    def rows(self, sql: str, *values: Any) -> list[tuple[Any, ...]]:
        """Return the rows of a query. Raises sqlite3.Error."""
        with self._lock:
            return self._connection().execute(sql, values).fetchall()

    def snapshot(self, *queries: tuple[str, Mapping[str, Any]]) -> list[list[tuple[Any, ...]]]:
        """Return the rows of several queries at one moment. Raises sqlite3.Error."""
        with self._lock:
            return [self._connection().execute(sql, values).fetchall() for sql, values in queries]

    def used_bytes(self) -> int:
        """Return the size of the file without its free pages."""
        pages, free, size = (
            self.rows(f"PRAGMA {name}")[0][0] for name in ("page_count", "freelist_count", "page_size")
        )
        return int((pages - free) * size)

    def _connection(self) -> sqlite3.Connection:
        """Return the open connection. Raises sqlite3.Error or OSError."""
        if self._open is None:
            try:
                self._open = self._opened()
            except sqlite3.DatabaseError as error:
                if self._path is None or not is_damage(error):
                    raise
                self._recovery.set_aside(self._path, damaged(error), INSTEAD)
                self._open = self._opened()
            weakref.finalize(self, self._open.close).atexit = False  # a thread may still be in a statement then
        return self._open

    def _opened(self) -> sqlite3.Connection:
        if self._path is not None:
            _make(self._path.parent)
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
        if version < _RELEASED and tables:
            raise EventFileError(f"{self._path} is another kind of database: move the file away")
        for step in _STEPS[version - _RELEASED :] if version else ():
            version += 1
            connection.executescript(f"BEGIN; {step} PRAGMA user_version = {version}; COMMIT;")
        if self._path is not None and version > VERSION:
            raise EventFileError(later_schema(self._path, version, VERSION, self._path))
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")  # an event that was answered with survives a power failure
        connection.execute("PRAGMA journal_size_limit = 67108864")
        if version == 0:
            connection.executescript(f"BEGIN; {_SCHEMA} COMMIT;")


def _make(folder: Path) -> None:
    """Make the folder. Raises sqlite3.Error, as everything does that fails at the first use of a file."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise sqlite3.OperationalError(str(error)) from error
