"""The starts on which stored events hang, and the events that say that others are not true."""

import sqlite3
from typing import Any

import orjson

from dropanchor_schemas.events import RetractionReason
from dropanchor_schemas.zones import EventType
from dropanchor_service.events.database import Database
from dropanchor_service.events.drafts import Draft, StartBegan, StartClosed, StateValue

OF_PLACES = (
    EventType.ZONE_ENTER,
    EventType.ZONE_EXIT,
    EventType.ZONE_DWELL,
    EventType.ZONE_SPEED,
    EventType.TAGS_TOO_CLOSE,
)
"""What is made from the place of a tag, and so from its start."""

_KEPT = ("zone", "rule", "name", "other_tag")
_EVENTS = f"""
SELECT body FROM events WHERE sequence >= ? AND type IN ({",".join("?" * len(OF_PLACES))})
AND (tag = ? OR (type = '{EventType.TAGS_TOO_CLOSE.value}' AND json_extract(body, '$.data.other_tag') = ?))
AND json_extract(body, '$.id') NOT IN (
    SELECT json_extract(body, '$.data.retracts') FROM events
    WHERE sequence >= ? AND type = '{EventType.EVENT_RETRACTED.value}'
) ORDER BY sequence
"""


def starts_of(database: Database) -> dict[str, StartBegan]:
    """Return the starts on which events hang, by tag. Raises sqlite3.Error."""
    if not database.is_made:
        return {}
    rows = database.rows("SELECT tag, place, before, since_ns, inside FROM starts")
    return {tag: StartBegan(tag, place, before, since, _inside(text)) for tag, place, before, since, text in rows}


def add_start(connection: sqlite3.Connection, start: StartBegan, first: int) -> None:
    """Store a start. first: sequence of the next event."""
    inside = orjson.dumps({zone: list(value) for zone, value in start.inside.items()}).decode()
    connection.execute(
        "INSERT OR REPLACE INTO starts (tag, place, before, first, since_ns, inside) VALUES (?, ?, ?, ?, ?, ?)",
        (start.tag, start.place, start.before, first, start.since_ns, inside),
    )


def close_start(connection: sqlite3.Connection, closed: StartClosed) -> list[Draft]:
    """Forget a start. If what hangs on it is not true, delete its stays, and return the events that say so."""
    found = connection.execute("SELECT first, since_ns, inside FROM starts WHERE tag = ?", (closed.tag,)).fetchone()
    connection.execute("DELETE FROM starts WHERE tag = ?", (closed.tag,))
    if found is None or closed.retracts is None:
        return []
    first, since_ns, inside = found
    reopened = [(closed.tag, zone, value.since_ns) for zone, value in _inside(inside).items()]
    connection.execute("DELETE FROM stays WHERE tag = ? AND entered_ns >= ?", (closed.tag, since_ns))
    connection.executemany("DELETE FROM stays WHERE tag = ? AND zone = ? AND entered_ns = ?", reopened)
    types = [kind.value for kind in OF_PLACES]
    events = connection.execute(_EVENTS, (first, *types, closed.tag, closed.tag, first)).fetchall()
    return [_retraction(orjson.loads(body), closed.t_ns, closed.retracts) for (body,) in events]


def _retraction(event: Any, t_ns: int, reason: RetractionReason) -> Draft:
    """Return the event that says that a stored one is not true."""
    data = {name: event["data"][name] for name in _KEPT} | {"t_ns": t_ns, "since_ns": event["data"]["t_ns"]}
    data |= {"retracts": event["id"], "retracted_type": event["type"], "reason": reason.value}
    return Draft(EventType.EVENT_RETRACTED, event["subject"], data)


def _inside(text: str) -> dict[str, StateValue]:
    return {zone: StateValue(*value) for zone, value in orjson.loads(text).items()}
