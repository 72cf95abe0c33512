"""The alarms: rows that stand in the file of the events, begin with an event, and end with another one."""

import sqlite3
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import orjson

from dropanchor_schemas.alarms import Acknowledgement
from dropanchor_schemas.zones import EventType
from dropanchor_service.events.database import Database
from dropanchor_service.events.drafts import AlarmBegan, AlarmsOver, Draft, StateKey

CURRENT = "(over_ns IS NULL OR acknowledged IS NULL)"
OPEN = "over_ns IS NULL"
_OF_STATE = f"source = ? AND item = ? AND tag = ? AND other = ? AND flag & ? AND {OPEN}"
_KEPT = ("since_ns", "zone", "rule", "name", "other_tag", "severity")


class StoredAlarm(NamedTuple):
    """source, item: whose alarm it is, as in StateKey. acknowledged, body: an Acknowledgement and an Event in JSON."""

    sequence: int
    id: str
    source: str
    item: str
    severity: str
    over_ns: int | None
    acknowledged: str | None
    body: bytes


_COLUMNS = ", ".join(StoredAlarm._fields)


def alarms(database: Database, condition: str, before: int, tags: Sequence[str], limit: int) -> list[StoredAlarm]:
    """Return the newest alarms with a lower sequence, at most `limit`. tags: empty for all. Raises sqlite3.Error."""
    if not database.is_made:
        return []
    sql = (
        f"SELECT {_COLUMNS} FROM alarms WHERE {condition} AND sequence < :before AND (:tags = '[]' OR "
        "tag IN (SELECT value FROM json_each(:tags)) OR other IN (SELECT value FROM json_each(:tags))) "
        "ORDER BY sequence DESC LIMIT :limit"
    )
    values = {"tags": orjson.dumps(list(tags)).decode(), "before": before, "limit": limit}
    return [StoredAlarm(*row) for row in database.snapshot((sql, values))[0]]


def alarm_of(database: Database, alarm: str) -> StoredAlarm | None:
    """Return the alarm with this id. Raises sqlite3.Error."""
    rows = database.rows(f"SELECT {_COLUMNS} FROM alarms WHERE id = ?", alarm) if database.is_made else []
    return StoredAlarm(*rows[0]) if rows else None


def open_alarms(database: Database) -> Mapping[StateKey, int]:
    """Return the flags on which alarms hang, by state. Raises sqlite3.Error."""
    if not database.is_made:
        return {}
    flags: dict[StateKey, int] = {}
    for *key, flag in database.rows(f"SELECT source, item, tag, other, flag FROM alarms WHERE {OPEN}"):
        flags[StateKey(*key)] = flags.get(StateKey(*key), 0) | flag
    return flags


def begin_alarm(connection: sqlite3.Connection, alarm: AlarmBegan, sequence: int, body: bytes) -> None:
    event = orjson.loads(body)
    connection.execute(
        "INSERT INTO alarms (sequence, id, source, item, tag, other, flag, severity, body) "
        "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
        (sequence, event["id"], *alarm.key, alarm.flag, event["data"]["severity"], body),
    )


def end_alarms(connection: sqlite3.Connection, over: AlarmsOver) -> list[Draft]:
    """End the alarms that hang on these flags. Return the events that say so."""
    return _end(connection, _OF_STATE, (*over.key, over.flags), over.t_ns, over.is_muted)


def end_retracted(connection: sqlite3.Connection, retractions: Sequence[Draft]) -> list[Draft]:
    """End the alarms whose beginning is retracted. Return the events that say so."""
    return [
        over
        for draft in retractions
        for over in _end(connection, f"id = ? AND {OPEN}", (draft.data["retracts"],), draft.t_ns, draft.is_muted)
    ]


def _end(
    connection: sqlite3.Connection, condition: str, values: tuple[Any, ...], t_ns: int, is_muted: bool
) -> list[Draft]:
    found = connection.execute(f"SELECT body FROM alarms WHERE {condition}", values).fetchall()
    connection.execute(f"UPDATE alarms SET over_ns = ? WHERE {condition}", (t_ns, *values))
    return [_about(EventType.ALARM_OVER, orjson.loads(body), {"t_ns": t_ns}, is_muted) for (body,) in found]


def acknowledge(connection: sqlite3.Connection, alarm: str, said: Acknowledgement) -> Draft:
    """Note that somebody has seen an alarm. Return the event that says so. Raises KeyError where there is none."""
    row = connection.execute("SELECT body FROM alarms WHERE id = ?", (alarm,)).fetchone()
    if row is None:
        raise KeyError(alarm)
    connection.execute("UPDATE alarms SET acknowledged = ? WHERE id = ?", (said.model_dump_json(), alarm))
    data = {"t_ns": said.t_ns, "acknowledged_by": said.by.name, "note": said.note}
    return _about(EventType.ALARM_ACKNOWLEDGED, orjson.loads(row[0]), data)


def _about(kind: EventType, began: Any, data: dict[str, Any], is_muted: bool = False) -> Draft:
    kept = {name: began["data"][name] for name in _KEPT}
    return Draft(
        kind, began["subject"], kept | {"alarm": began["id"], "alarm_type": began["type"]} | data, is_muted=is_muted
    )


def prune_alarms(connection: sqlite3.Connection, up_to: int) -> None:
    """Delete the alarms of events up to this sequence, but for those that are not over."""
    connection.execute("DELETE FROM alarms WHERE sequence <= ? AND over_ns IS NOT NULL", (up_to,))
