"""Poses of long ago in a SQLite file: written by one thread, read by any, in order of time.

Rows are clustered by slot of ten seconds, then tag, then time. So poses that come together are written together, what
is oldest lies at the beginning, where it is cheap to delete, and a track is one seek per slot.
"""

import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array

VERSION = 1
SLOT_NS = 10_000_000_000
MOST_ROWS = 512  # of a statement: sqlite3 gives up the interpreter's lock with each, and has to win it back
BUSY_S = 5.0

# What a row holds beside its key, 66 bytes; float32 is exact to 0.2 mm at 3 km.
RECORD = np.dtype(
    [
        *(("state", "u1"), ("reason", "u1"), ("anchor", "<i4")),  # anchor: id in the file's table, -1: none
        *((name, "<f4") for name in ("range", "x", "y", "heading", "speed", "yaw_rate")),
        ("cov", "<f4", 6),  # xx, xy, xh, yy, yh, hh
        *((name, "<f4") for name in ("p_mode", "sigma_pos", "sigma_obs")),
    ]
)
_SAME = ("state", "reason", "range", "x", "y", "heading", "speed", "yaw_rate", "p_mode", "sigma_pos", "sigma_obs")
_UPPER = np.triu_indices(3)

_SCHEMA = f"""
CREATE TABLE tags (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE anchors (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE slots (slot INTEGER PRIMARY KEY);
CREATE TABLE poses (
    slot INTEGER NOT NULL, tag INTEGER NOT NULL, t_ns INTEGER NOT NULL, pose BLOB NOT NULL,
    PRIMARY KEY (slot, tag, t_ns)
) WITHOUT ROWID;
PRAGMA user_version = {VERSION};
"""
_FORWARD = """
SELECT t_ns, pose FROM slots CROSS JOIN poses USING (slot)
WHERE slots.slot BETWEEN ? AND ? AND tag = ? AND t_ns BETWEEN ? AND ? ORDER BY slots.slot, t_ns LIMIT ?
"""
_BACKWARD = _FORWARD.replace("slots.slot, t_ns", "slots.slot DESC, t_ns DESC")


@dataclass(frozen=True)
class Stored:
    """poses: POSE, whose rows and anchor indices say nothing; anchors: the id of the anchor of each."""

    poses: Array
    anchors: list[str | None]


NOTHING = Stored(np.empty(0, POSE), [])


class TrackFileError(sqlite3.Error):
    """The file is there and is not one of ours."""


class TrackWriter:
    """The one connection that writes. Every method raises sqlite3.Error, and then nothing has changed."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._connection = sqlite3.connect(path, BUSY_S, isolation_level=None, check_same_thread=False)
        try:
            self._prepare()
        except sqlite3.Error:
            self._connection.close()
            raise
        self._ids: dict[tuple[str, str], int] = {}

    def close(self) -> None:
        self._connection.close()

    def insert(self, poses: Array, tags: Sequence[str], anchors: Sequence[str | None]) -> None:
        """poses: POSE, with the name of the tag and of the anchor of each. A pose of the same time is replaced."""
        with self._transaction():
            tag_ids = self._numbers("tags", tags)
            anchor_ids = self._numbers("anchors", anchors)
            order = np.lexsort((poses["t_ns"], tag_ids, poses["t_ns"] // SLOT_NS))
            slots = (poses["t_ns"] // SLOT_NS)[order]
            self._connection.executemany(
                "INSERT OR IGNORE INTO slots VALUES (?)", [(slot,) for slot in np.unique(slots).tolist()]
            )
            blobs = _records(poses[order], anchor_ids[order])
            self._insert(slots.tolist(), tag_ids[order].tolist(), poses["t_ns"][order].tolist(), blobs)

    def prune(self, keep_from_ns: int, most_bytes: int) -> int:
        """Delete the oldest slot if it is older than that time, or if the file is larger; how many were deleted."""
        oldest = self._connection.execute("SELECT min(slot) FROM slots").fetchone()[0]
        if oldest is None or ((oldest + 1) * SLOT_NS > keep_from_ns and self.used_bytes() <= most_bytes):
            return 0
        with self._transaction():
            self._connection.execute("DELETE FROM poses WHERE slot <= ?", (oldest,))
            self._connection.execute("DELETE FROM slots WHERE slot <= ?", (oldest,))
        return 1

    def used_bytes(self) -> int:
        """Without pages that are free to be used again."""
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
            self._ids.clear()  # some may be of this transaction
            if self._connection.in_transaction:  # a full disk may have ended it already
                self._connection.execute("ROLLBACK")
            raise

    def _prepare(self) -> None:
        version = self._connection.execute("PRAGMA user_version").fetchone()[0]
        tables = self._connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0]
        if version not in (0, VERSION) or (version == 0 and tables):
            raise TrackFileError(f"the file has schema version {version}, this service knows {VERSION}")
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._connection.execute("PRAGMA synchronous = NORMAL")
        self._connection.execute("PRAGMA journal_size_limit = 67108864")
        if version == 0:
            self._connection.executescript(f"BEGIN; {_SCHEMA} COMMIT;")

    def _insert(self, slots: list[int], tags: list[int], times: list[int], blobs: list[bytes]) -> None:
        flat = [value for row in zip(slots, tags, times, blobs, strict=True) for value in row]
        start = 0
        for rows in _powers(len(slots)):
            places = ",".join(["(?,?,?,?)"] * rows)
            values = flat[start : start + 4 * rows]
            self._connection.execute(f"INSERT OR REPLACE INTO poses VALUES {places}", values)
            start += len(values)

    def _numbers(self, table: str, names: Sequence[str | None]) -> Array:
        """The ids of these names in one of the tables of names, -1 for None."""
        numbers = {name: -1 if name is None else self._number(table, name) for name in set(names)}
        return np.array([numbers[name] for name in names], np.int64)

    def _number(self, table: str, name: str) -> int:
        number = self._ids.get((table, name))
        if number is None:
            self._connection.execute(f"INSERT OR IGNORE INTO {table} (name) VALUES (?)", (name,))
            found = self._connection.execute(f"SELECT id FROM {table} WHERE name = ?", (name,)).fetchone()
            number = int(found[0])
            self._ids[table, name] = number
        return number


class TrackReader:
    """Opens the file for every question, so that no reader holds anything while nobody asks."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def poses(self, tag: str, from_ns: int, to_ns: int, most: int, newest_first: bool = False) -> Stored:
        """Those between the two times, both included. Raises sqlite3.Error; a file that does not exist holds none."""
        if not self._path.exists():
            return NOTHING
        with self._connected() as connection:
            number = _tag_number(connection, tag)
            sql = _BACKWARD if newest_first else _FORWARD
            window = (from_ns // SLOT_NS, to_ns // SLOT_NS, number, from_ns, to_ns, most)
            rows = connection.execute(sql, window).fetchall()
            names = dict(connection.execute("SELECT id, name FROM anchors"))
        return _stored(rows, names)

    def knows(self, tag: str) -> bool:
        """Whether there ever was a pose of this tag. Raises sqlite3.Error."""
        if not self._path.exists():
            return False
        with self._connected() as connection:
            return _tag_number(connection, tag) is not None

    def _connected(self) -> closing[sqlite3.Connection]:
        return closing(sqlite3.connect(f"{self._path.absolute().as_uri()}?mode=ro", BUSY_S, uri=True))


def _powers(count: int) -> Iterator[int]:
    """Powers of two, MOST_ROWS at most, that add up to the count: sqlite3 keeps the last 128 different statements, and
    one for every number of rows would be 20 MB of them."""
    while count:
        rows = min(MOST_ROWS, 1 << (count.bit_length() - 1))
        yield rows
        count -= rows


def _tag_number(connection: sqlite3.Connection, tag: str) -> int | None:
    found = connection.execute("SELECT id FROM tags WHERE name = ?", (tag,)).fetchone()
    return None if found is None else int(found[0])


def _records(poses: Array, anchors: Array) -> list[bytes]:
    """RECORD of each POSE."""
    records = np.zeros(len(poses), RECORD)
    for name in _SAME:
        records[name] = poses[name]
    records["anchor"] = anchors
    records["cov"] = poses["cov"][:, *_UPPER]
    packed, size = records.tobytes(), RECORD.itemsize
    return [packed[start : start + size] for start in range(0, len(packed), size)]


def _stored(rows: Sequence[tuple[int, bytes]], anchor_names: Mapping[int, str]) -> Stored:
    records = np.frombuffer(b"".join([blob for _, blob in rows]), RECORD)
    poses = np.zeros(len(rows), POSE)
    poses["row"], poses["anchor"] = -1, -1
    poses["t_ns"] = [t_ns for t_ns, _ in rows]
    for name in _SAME:
        poses[name] = records[name]
    poses["cov"][:, *_UPPER] = records["cov"]
    poses["cov"][:, *_UPPER[::-1]] = records["cov"]
    return Stored(poses, [anchor_names.get(number) for number in records["anchor"].tolist()])
