"""What is stored in the database of a site, for those who read and summarise it."""

from collections.abc import Iterator, Sequence
from typing import Any

from psycopg import Connection

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.postgresql.days import DAY_NS
from dropanchor_service.history.postgresql.pose_columns import POINTS, STORED, arrays, stored_poses, summaries
from dropanchor_service.history.postgresql.schema import FENCED
from dropanchor_service.history.records import NO_POSES, SLOT_NS, StoredPoses
from dropanchor_service.history.stored import Kind
from dropanchor_service.history.summary_table import LENGTHS_NS

_CHUNK_NS = 60_000_000_000  # whose poses are read at once

_PAGE = """
SELECT {arrays} FROM (
    SELECT {columns} FROM poses p
    WHERE site = %s AND tag = %s AND t_ns BETWEEN %s AND %s AND NOT {fenced} ORDER BY t_ns {order} LIMIT %s
) AS page
"""
_CHUNKS = f"""
SELECT {arrays(POINTS)} FROM poses p
WHERE site = %s AND t_ns BETWEEN %s AND %s AND (%s::integer[] IS NULL OR tag = ANY (%s)) AND NOT {FENCED}
GROUP BY t_ns / {_CHUNK_NS}
"""
_FILLED = """
SELECT n FROM generate_series(0, %s::bigint - 1) AS part(n)
WHERE EXISTS (SELECT FROM slots WHERE site = %s AND t_ns >= %s + n * %s::bigint AND t_ns < %s + (n + 1) * %s::bigint)
ORDER BY n
"""
_STRETCHES = "FROM stretches WHERE site = %s AND level = %s AND from_ns >= %s AND from_ns < %s"
_PUT = """
INSERT INTO stretches (site, level, from_ns, epoch, summaries, heads, cells) VALUES (%s, %s, %s, %s, %s, %s, %s)
ON CONFLICT (site, level, from_ns) DO UPDATE
SET epoch = excluded.epoch, summaries = excluded.summaries, heads = excluded.heads, cells = excluded.cells
"""
_DELETE = "DELETE FROM stretches WHERE site = %s AND level = %s AND from_ns = ANY (%s)"
_MISS = "INSERT INTO missing SELECT %s, %s, unnest(%s::bigint[]) ON CONFLICT DO NOTHING"
_DELETE_FROM = f"""
WITH gone AS (DELETE FROM stretches WHERE site = %s AND from_ns > %s - {DAY_NS} RETURNING site, level, from_ns)
INSERT INTO missing SELECT site, level, from_ns FROM gone ON CONFLICT DO NOTHING
"""
_BLOBS: dict[Kind, tuple[str, ...]] = {"summaries": ("summaries",), "heat": ("heads", "cells")}


class PostgresqlRows:
    """The `WritableTracks` of a site in a transaction. Every method raises psycopg.Error.

    Unlike in a file, a table names the missing summaries, so that every service that writes a site knows them.
    """

    def __init__(self, connection: Connection, site: int, epoch: int = 0) -> None:
        self._connection = connection
        self._site = site
        self._epoch = epoch

    def tag_names(self) -> dict[int, str]:
        return dict(self._all("SELECT id, name FROM tags WHERE site = %s", self._site))

    def has_tag(self, tag: str) -> bool:
        return self._tag_id(tag) is not None

    def span(self) -> tuple[int, int] | None:
        ((oldest, newest),) = self._all("SELECT min(t_ns), max(t_ns) FROM slots WHERE site = %s", self._site)
        return None if oldest is None else (oldest, newest + SLOT_NS)

    def poses(self, tag: str, from_ns: int, to_ns: int, limit: int, newest_first: bool) -> StoredPoses:
        tag_id = self._tag_id(tag)
        if tag_id is None:
            return NO_POSES
        order = "DESC" if newest_first else "ASC"
        sql = _PAGE.format(arrays=arrays(STORED), columns=", ".join(STORED), fenced=FENCED, order=order)
        (row,) = self._all(sql, self._site, tag_id, from_ns, to_ns, limit)
        if row[0] is None:
            return NO_POSES
        return stored_poses(row, dict(self._all("SELECT id, name FROM anchors WHERE site = %s", self._site)))

    def summaries_of_poses(self, from_ns: int, to_ns: int, tags: Sequence[int] | None) -> Iterator[Array]:
        wanted = None if tags is None else list(tags)
        with self._connection.cursor(binary=True) as cursor:
            for row in cursor.stream(_CHUNKS, (self._site, from_ns, to_ns, wanted, wanted), binary=True):
                yield summaries(row)

    def count_slots(self, from_ns: int, to_ns: int) -> int:
        sql = "SELECT count(*) FROM slots WHERE site = %s AND t_ns > %s AND t_ns <= %s"
        return int(self._all(sql, self._site, from_ns - SLOT_NS, to_ns)[0][0])

    def filled_parts(self, first_slot: int, slots: int, count: int) -> list[int]:
        first, length = first_slot * SLOT_NS, slots * SLOT_NS
        return [n for (n,) in self._all(_FILLED, count, self._site, first, length, first, length)]

    def stretch_bytes(self, kind: Kind, level: int, stretches: range) -> int:
        size = " + ".join(f"octet_length({blob})" for blob in _BLOBS[kind])
        sql = f"SELECT coalesce(sum({size}), 0)::bigint {_STRETCHES}"
        return int(self._all(sql, self._site, level, *_limits(level, stretches))[0][0])

    def stretches(self, kind: Kind, level: int, stretches: range) -> dict[int, tuple[bytes, ...]]:
        sql = f"SELECT from_ns, {', '.join(_BLOBS[kind])} {_STRETCHES} ORDER BY from_ns"
        rows = self._all(sql, self._site, level, *_limits(level, stretches))
        return {row[0] // LENGTHS_NS[level]: row[1:] for row in rows}

    def newest_slot(self) -> int | None:
        ((newest,),) = self._all("SELECT max(t_ns) FROM slots WHERE site = %s", self._site)
        return None if newest is None else newest // SLOT_NS

    def missing_stretches(self, level: int) -> set[int]:
        found = self._all("SELECT from_ns FROM missing WHERE site = %s AND level = %s", self._site, level)
        return {from_ns // LENGTHS_NS[level] for (from_ns,) in found}

    def put_stretch(self, level: int, stretch: int, summaries: bytes | None, heads: bytes, cells: bytes) -> None:
        key = (self._site, level, stretch * LENGTHS_NS[level])
        self._connection.execute(_PUT, (*key, self._epoch, summaries or b"", heads, cells))
        self._connection.execute("DELETE FROM missing WHERE site = %s AND level = %s AND from_ns = %s", key)

    def delete_stretches(self, level: int, stretches: Sequence[int]) -> None:
        starts = [stretch * LENGTHS_NS[level] for stretch in stretches]
        for sql in (_DELETE, _MISS):
            self._connection.execute(sql, (self._site, level, starts))

    def delete_stretches_from(self, from_ns: int) -> None:
        """Delete the blobs of every level and all stretches that end after a time, and perhaps of some before."""
        self._connection.execute(_DELETE_FROM, (self._site, from_ns))

    def _tag_id(self, tag: str) -> int | None:
        found = self._all("SELECT id FROM tags WHERE site = %s AND name = %s", self._site, tag)
        return found[0][0] if found else None

    def _all(self, sql: str, *values: object) -> list[tuple[Any, ...]]:
        return self._connection.execute(sql, values, binary=True).fetchall()


def _limits(level: int, stretches: range) -> tuple[int, int]:
    """Return the start of the first stretch, and the end of the last one."""
    return stretches.start * LENGTHS_NS[level], stretches.stop * LENGTHS_NS[level]
