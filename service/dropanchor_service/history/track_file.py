"""Stored poses in a SQLite file, which one thread writes and any thread reads.

Rows are clustered by ten-second slot, then tag, then time. Poses that arrive together are therefore written together.
The oldest lie at the beginning, where deleting is cheap. Reading a track takes one seek per slot.
"""

import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array, Frame

VERSION = 1
SLOT_NS = 10_000_000_000
MAX_ROWS = 512  # per statement: sqlite3 releases the interpreter's lock in each one and must win it back
BUSY_S = 5.0

# The content of a row beside its key, 66 bytes. At 3 km float32 is exact to 0.2 mm.
RECORD = np.dtype(
    [
        *(("state", "u1"), ("reason", "u1"), ("anchor", "<i4")),  # state: bit 7 is the frame; anchor: its id, -1: none
        *((name, "<f4") for name in ("range", "x", "y", "heading", "speed", "yaw_rate")),
        ("cov", "<f4", 6),  # xx, xy, xh, yy, yh, hh
        *((name, "<f4") for name in ("p_mode", "sigma_pos", "sigma_obs")),
    ]
)
_SAME_IN_POSE = (
    "state",
    "reason",
    "range",
    "x",
    "y",
    "heading",
    "speed",
    "yaw_rate",
    "p_mode",
    "sigma_pos",
    "sigma_obs",
)
_RELATIVE = 0x80  # bit of the state that says that the pose is in a frame of the tag's own
_UPPER_TRIANGLE = np.triu_indices(3)

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
class StoredPoses:
    """Poses from the file. poses: POSE with rows and anchor indices of -1; anchors: the anchor id of each pose."""

    poses: Array
    anchors: list[str | None]


NO_POSES = StoredPoses(np.empty(0, POSE), [])


class TrackFileError(sqlite3.Error):
    """The file has another schema version or is another kind of database."""


class TrackWriter:
    """The only connection that writes. Every method raises sqlite3.Error and then has changed nothing."""

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
            blobs = _records(poses[order], anchor_ids[order])
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
        return 1

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
        if version not in (0, VERSION) or (version == 0 and tables):
            raise TrackFileError(
                f"the file has schema version {version}, but this service needs {VERSION}: move the file away"
            )
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._connection.execute("PRAGMA synchronous = NORMAL")
        self._connection.execute("PRAGMA journal_size_limit = 67108864")
        if version == 0:
            self._connection.executescript(f"BEGIN; {_SCHEMA} COMMIT;")

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
        return _stored(rows, names)

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


def _records(poses: Array, anchors: Array) -> list[bytes]:
    """Return the RECORD of each POSE as bytes."""
    records = np.zeros(len(poses), RECORD)
    for name in _SAME_IN_POSE:
        records[name] = poses[name]
    records["anchor"] = anchors
    records["state"] |= np.where(poses["frame"] == Frame.RELATIVE, _RELATIVE, 0).astype(np.uint8)
    records["cov"] = poses["cov"][:, *_UPPER_TRIANGLE]
    packed, size = records.tobytes(), RECORD.itemsize
    return [packed[start : start + size] for start in range(0, len(packed), size)]


def _stored(rows: Sequence[tuple[int, bytes]], anchor_names: Mapping[int, str]) -> StoredPoses:
    records = np.frombuffer(b"".join([blob for _, blob in rows]), RECORD)
    poses = np.zeros(len(rows), POSE)
    poses["row"], poses["anchor"] = -1, -1
    poses["t_ns"] = [t_ns for t_ns, _ in rows]
    for name in _SAME_IN_POSE:
        poses[name] = records[name]
    poses["frame"] = np.where(records["state"] & _RELATIVE, Frame.RELATIVE, Frame.SITE)
    poses["state"] &= ~np.uint8(_RELATIVE)
    poses["cov"][:, *_UPPER_TRIANGLE] = records["cov"]
    poses["cov"][:, *_UPPER_TRIANGLE[::-1]] = records["cov"]
    return StoredPoses(poses, [anchor_names.get(anchor_id) for anchor_id in records["anchor"].tolist()])
