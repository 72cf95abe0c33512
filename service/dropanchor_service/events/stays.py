"""For how long tags were in zones: the stays that have ended, and those of tags that are inside."""

import sqlite3
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from dropanchor_service.events.database import Database
from dropanchor_service.events.drafts import Stay

_ENDED = """
SELECT tag, zone, sum(min(left_ns, :to) - max(entered_ns, :from)), count(*) FROM stays
WHERE left_ns > :from AND entered_ns < :to GROUP BY tag, zone
"""
_INSIDE = "SELECT tag, item, since_ns FROM states WHERE source = 'zone' AND since_ns < :to"


class TimeInZone(NamedTuple):
    """How long a tag was in a zone, and in how many stays."""

    inside_ns: int
    stays: int


def add_stays(connection: sqlite3.Connection, stays: Sequence[Stay]) -> None:
    connection.executemany("INSERT INTO stays VALUES (?, ?, ?, ?)", stays)


def prune_stays(connection: sqlite3.Connection, keep_from_ns: int | None, limit: int) -> None:
    """Delete up to `limit` of the oldest stays, of those that ended earlier than this, if it is not None."""
    condition = "1" if keep_from_ns is None else "left_ns < ?"
    values = [] if keep_from_ns is None else [keep_from_ns]
    connection.execute(
        f"DELETE FROM stays WHERE rowid IN (SELECT rowid FROM stays WHERE {condition} ORDER BY left_ns LIMIT {limit})",
        values,
    )


def times_in_zones(
    database: Database, from_ns: int, to_ns: int, until_ns: Mapping[str, int]
) -> dict[tuple[str, str], TimeInZone]:
    """Return the time of each tag in each zone between two times.

    until_ns: until when a tag that has not left counts; one without a time counts for nothing. Raises sqlite3.Error.
    """
    if not database.is_made:
        return {}
    period = {"from": from_ns, "to": to_ns}
    ended, inside = database.snapshot((_ENDED, period), (_INSIDE, period))
    times = {(tag, zone): TimeInZone(inside_ns, stays) for tag, zone, inside_ns, stays in ended}
    for tag, zone, since_ns in inside:
        inside_ns = min(until_ns.get(tag, 0), to_ns) - max(since_ns, from_ns)
        if inside_ns > 0:
            before = times.get((tag, zone), TimeInZone(0, 0))
            times[tag, zone] = TimeInZone(before.inside_ns + inside_ns, before.stays + 1)
    return times
