"""What is stored in the SQLite file, for those who read and summarise it.

The sqlite3 module gives up the interpreter's lock for every row that it fetches, and must win it back from the engine.
So SQLite joins all poses of a slot into one text, and each slot is one row.
"""

import sqlite3
from collections.abc import Iterator, Sequence

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.records import NO_HEIGHT, NO_POSES, RECORD, SLOT_NS, StoredPoses, stored_poses
from dropanchor_service.history.stored import Kind
from dropanchor_service.history.summaries import POINT, SAME_IN_POINT, summary_of_each
from dropanchor_service.history.summary_table import DAY, SLOTS
from dropanchor_service.store.records import take

MAX_NAMED = 100  # tags: beyond, reading all of them is faster than a search for each

_JOINED = np.dtype([("tag", ">u4"), ("t_ns", ">i8"), ("pose", RECORD)])
_WHOLE = f"substr(hex(pose) || '{NO_HEIGHT.hex()}', 1, {2 * RECORD.itemsize})"  # some end before the height
_OF_SLOTS = f"""
SELECT group_concat(printf('%08x%016x', tag, t_ns) || {_WHOLE}, '') FROM slots CROSS JOIN poses USING (slot)
WHERE slots.slot BETWEEN ? AND ? AND t_ns BETWEEN ? AND ? {{tags}} GROUP BY slots.slot
"""
_FORWARD = """
SELECT t_ns, pose FROM slots CROSS JOIN poses USING (slot)
WHERE slots.slot BETWEEN ? AND ? AND tag = ? AND t_ns BETWEEN ? AND ? ORDER BY slots.slot, t_ns LIMIT ?
"""
_BACKWARD = _FORWARD.replace("slots.slot, t_ns", "slots.slot DESC, t_ns DESC")
_MISSING = "SELECT DISTINCT slot / ? FROM slots EXCEPT SELECT stretch FROM heat WHERE level = ?"
_STRETCHES = "WHERE level = ? AND stretch BETWEEN ? AND ?"
_FILLED = """
WITH RECURSIVE part(n) AS (SELECT 0 UNION ALL SELECT n + 1 FROM part WHERE n + 1 < :count)
SELECT group_concat(n) FROM part
WHERE EXISTS (SELECT 1 FROM slots WHERE slot >= :first + n * :slots AND slot < :first + (n + 1) * :slots)
"""
_BLOBS: dict[Kind, tuple[str, ...]] = {"summaries": ("tags",), "heat": ("heads", "cells")}


class SqliteRows:
    """The `WritableTracks` of a connection, whose owner opens the transactions. Every method raises sqlite3.Error."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def tag_names(self) -> dict[int, str]:
        return dict(self._connection.execute("SELECT id, name FROM tags"))

    def has_tag(self, tag: str) -> bool:
        return self._tag_id(tag) is not None

    def span(self) -> tuple[int, int] | None:
        oldest, newest = self._connection.execute("SELECT min(slot), max(slot) FROM slots").fetchone()
        return None if oldest is None else (oldest * SLOT_NS, (newest + 1) * SLOT_NS)

    def poses(self, tag: str, from_ns: int, to_ns: int, limit: int, newest_first: bool) -> StoredPoses:
        tag_id = self._tag_id(tag)
        if tag_id is None:
            return NO_POSES
        window = (from_ns // SLOT_NS, to_ns // SLOT_NS, tag_id, from_ns, to_ns, limit)
        rows = self._connection.execute(_BACKWARD if newest_first else _FORWARD, window).fetchall()
        return stored_poses(rows, dict(self._connection.execute("SELECT id, name FROM anchors")))

    def summaries_of_poses(self, from_ns: int, to_ns: int, tags: Sequence[int] | None) -> Iterator[Array]:
        few = tags is not None and len(tags) <= MAX_NAMED
        named = f"AND tag IN ({','.join(map(str, tags))})" if few and tags is not None else ""
        window = (from_ns // SLOT_NS, to_ns // SLOT_NS, from_ns, to_ns)
        for (text,) in self._connection.execute(_OF_SLOTS.format(tags=named), window):
            joined = np.frombuffer(bytes.fromhex(text), _JOINED)
            yield _summaries(joined if tags is None or few else take(joined, np.isin(joined["tag"], tags)))

    def count_slots(self, from_ns: int, to_ns: int) -> int:
        count = "SELECT count(*) FROM slots WHERE slot BETWEEN ? AND ?"
        return int(self._connection.execute(count, (from_ns // SLOT_NS, to_ns // SLOT_NS)).fetchone()[0])

    def filled_parts(self, first_slot: int, slots: int, count: int) -> list[int]:
        values = {"first": first_slot, "slots": slots, "count": count}
        (joined,) = self._connection.execute(_FILLED, values).fetchone()
        return sorted(map(int, joined.split(","))) if joined else []

    def stretch_bytes(self, kind: Kind, level: int, stretches: range) -> int:
        size = " + ".join(f"length({blob})" for blob in _BLOBS[kind])
        sql = f"SELECT total({size}) FROM {kind} {_STRETCHES}"
        return int(self._connection.execute(sql, (level, stretches.start, stretches.stop - 1)).fetchone()[0])

    def stretches(self, kind: Kind, level: int, stretches: range) -> dict[int, tuple[bytes, ...]]:
        sql = f"SELECT stretch, {', '.join(_BLOBS[kind])} FROM {kind} {_STRETCHES} ORDER BY stretch"
        rows = self._connection.execute(sql, (level, stretches.start, stretches.stop - 1))
        return {row[0]: row[1:] for row in rows}

    def newest_slot(self) -> int | None:
        newest: int | None = self._connection.execute("SELECT max(slot) FROM slots").fetchone()[0]
        return newest

    def missing_stretches(self, level: int) -> set[int]:
        return {stretch for (stretch,) in self._connection.execute(_MISSING, (SLOTS[level], level))}

    def put_stretch(self, level: int, stretch: int, summaries: bytes | None, heads: bytes, cells: bytes) -> None:
        if level != DAY:
            sql = "INSERT OR REPLACE INTO summaries VALUES (?, ?, ?)"
            self._connection.execute(sql, (level, stretch, summaries))
        self._connection.execute("INSERT OR REPLACE INTO heat VALUES (?, ?, ?, ?)", (level, stretch, heads, cells))

    def delete_stretches(self, level: int, stretches: Sequence[int]) -> None:
        for table in _BLOBS:
            sql = f"DELETE FROM {table} WHERE level = ? AND stretch = ?"
            self._connection.executemany(sql, [(level, stretch) for stretch in stretches])

    def delete_stretches_before(self, level: int, stretch: int) -> None:
        """Delete the blobs of all stretches before this one."""
        for table in _BLOBS:
            self._connection.execute(f"DELETE FROM {table} WHERE level = ? AND stretch < ?", (level, stretch))

    def _tag_id(self, tag: str) -> int | None:
        found = self._connection.execute("SELECT id FROM tags WHERE name = ?", (tag,)).fetchone()
        return None if found is None else int(found[0])


def _summaries(joined: Array) -> Array:
    points, poses = np.zeros(len(joined), POINT), joined["pose"]
    points["t_ns"] = joined["t_ns"]
    for name in SAME_IN_POINT[1:]:
        points[name] = poses[name]
    points["cov_xx"], points["cov_xy"], points["cov_yy"] = poses["cov"][:, 0], poses["cov"][:, 1], poses["cov"][:, 3]
    return summary_of_each(joined["tag"], points)
