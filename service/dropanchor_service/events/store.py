"""Store events durably, together with the states behind them and their deliveries: one transaction for all three."""

import sqlite3
import uuid
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from threading import Lock
from typing import Any, NamedTuple

import orjson

from dropanchor_schemas.alarms import Acknowledgement
from dropanchor_schemas.events import EventData
from dropanchor_service.events.alarms import acknowledge, begin_alarm, end_alarms, end_retracted, prune_alarms
from dropanchor_service.events.database import Database
from dropanchor_service.events.drafts import (
    AlarmsOver,
    Draft,
    Happening,
    StartBegan,
    StateKey,
    States,
    StateValue,
    Stay,
)
from dropanchor_service.events.starts import add_start, close_start, starts_of
from dropanchor_service.events.stays import add_stays, prune_stays
from dropanchor_service.events.trail import prune_changes

PRUNED = 5_000  # events per transaction

_NEWEST = "SELECT coalesce(max(seq), 0) FROM sqlite_sequence WHERE name = 'events'"

_UNKNOWN = {
    name: field.default for name, field in EventData.model_fields.items() if not field.is_required()
}  # every event has every field

Addressees = Callable[[Draft], Sequence[str]]


class StoredEvent(NamedTuple):
    """sequence: its position. body: the CloudEvent as JSON."""

    sequence: int
    body: bytes


class Occupant(NamedTuple):
    """A tag in a zone, and when it came."""

    tag: str
    since_ns: int


@dataclass(frozen=True)
class Selection:
    """Which events. An empty list selects all."""

    tags: Sequence[str] = ()
    types: Sequence[str] = ()
    zones: Sequence[str] = ()
    since_ns: int | None = None
    to_ns: int | None = None
    before: int | None = None

    def where(self) -> tuple[str, list[Any]]:
        """Return the condition in SQL and its values."""
        parts, values = ["sequence > ?"], list[Any]()
        for column, names in (("tag", self.tags), ("type", self.types), ("zone", self.zones)):
            if names:
                parts.append(f"{column} IN ({','.join('?' * len(names))})")
                values += names
        bounds = (("t_ns >= ?", self.since_ns), ("t_ns <= ?", self.to_ns), ("sequence < ?", self.before))
        for condition, value in bounds:
            if value is not None:
                parts.append(condition)
                values.append(value)
        return " AND ".join(parts), values


EVERYTHING = Selection()


class EventStore:
    """The stored events. Any thread may use it. Every method raises sqlite3.Error."""

    def __init__(self, database: Database, site: str, addressees: Addressees = lambda _: ()) -> None:
        """addressees: returns the destinations that an event goes to."""
        self.database = database
        self.site = site
        self._addressees = addressees
        self.newest = int(database.rows(_NEWEST)[0][0]) if database.is_made else 0
        """The sequence of the newest event. Readers poll it."""
        self.dropped_deliveries = 0
        self.on_commit: list[Callable[[], None]] = []  # called after each commit, on its thread
        self._telling = Lock()

    def commit(self, happened: Sequence[Happening], states: States, stays: Sequence[Stay] = ()) -> int:
        """Store events, states and ended stays, and queue the events for their destinations. Return how many events."""
        with self.database.transaction() as connection:
            first = int(connection.execute(_NEWEST).fetchone()[0]) + 1
            following = self._add_all(connection, happened, first)
            connection.executemany(
                "INSERT OR REPLACE INTO states VALUES (?, ?, ?, ?, ?, ?)",
                [(*key, *value) for key, value in states.items() if value is not None],
            )
            connection.executemany(
                "DELETE FROM states WHERE source = ? AND item = ? AND tag = ? AND other = ?",
                [key for key, value in states.items() if value is None],
            )
            add_stays(connection, stays)
        self._tell(following - 1)
        return following - first

    def acknowledge(self, alarm: str, said: Acknowledgement) -> None:
        """Store that somebody has seen an alarm, and the event of it. Raises KeyError where there is none."""
        with self.database.transaction() as connection:
            first = int(connection.execute(_NEWEST).fetchone()[0]) + 1
            self._add(connection, [acknowledge(connection, alarm, said)], first)
        self._tell(first)

    def _tell(self, newest: int) -> None:
        """Tell of events up to this one. Two threads may do so in any order."""
        with self._telling:
            is_news, self.newest = newest > self.newest, max(newest, self.newest)
        for told in self.on_commit if is_news else ():
            told()

    def _add_all(self, connection: sqlite3.Connection, happened: Sequence[Happening], following: int) -> int:
        """Store what happened, in order, from this sequence on. Return the one that follows."""
        drafts: list[Draft] = []
        for one in happened:
            if isinstance(one, Draft):
                drafts.append(one)
                continue
            following, drafts = self._add(connection, drafts, following), []
            if isinstance(one, StartBegan):
                add_start(connection, one, following)
            elif isinstance(one, AlarmsOver):
                drafts = end_alarms(connection, one)
            else:
                drafts = close_start(connection, one)
                drafts += end_retracted(connection, drafts)
        return self._add(connection, drafts, following)

    def _add(self, connection: sqlite3.Connection, drafts: Sequence[Draft], first: int) -> int:
        """Store events and queue them, from the sequence `first` on. Return the one that follows."""
        rows = [
            (number, draft.type.value, draft.tag, draft.zone, draft.t_ns, cloud_event(draft, number, self.site))
            for number, draft in enumerate(drafts, first)
        ]
        connection.executemany("INSERT INTO events VALUES (?, ?, ?, ?, ?, ?)", rows)
        for draft, (number, *_, body) in zip(drafts, rows, strict=True):
            if draft.alarm is not None:
                begin_alarm(connection, draft.alarm, number, body)
        connection.executemany(
            "INSERT INTO deliveries (destination, sequence) VALUES (?, ?)",
            [
                (destination, number)
                for number, draft in enumerate(drafts, first)
                for destination in self._addressees(draft)
            ],
        )
        return first + len(drafts)

    def starts(self) -> dict[str, StartBegan]:
        """Return the starts on which events hang, by tag."""
        return starts_of(self.database)

    def states(self) -> dict[StateKey, StateValue]:
        """Return all states."""
        if not self.database.is_made:
            return {}
        rows = self.database.rows("SELECT source, item, tag, other, flags, since_ns FROM states")
        return {StateKey(*row[:4]): StateValue(*row[4:]) for row in rows}

    def occupants(self) -> dict[str, list[Occupant]]:
        """Return the tags in each zone that is not empty, those first that have been there longest."""
        inside: dict[str, list[Occupant]] = {}
        sql = "SELECT item, tag, since_ns FROM states WHERE source = 'zone' ORDER BY item, since_ns, tag"
        for zone, tag, since_ns in self.database.rows(sql) if self.database.is_made else ():
            inside.setdefault(zone, []).append(Occupant(tag, since_ns))
        return inside

    def forget(self, source: str, items: Sequence[str]) -> None:
        """Delete the states of zones or rules that no longer exist."""
        with self.database.transaction() as connection:
            connection.executemany(
                "DELETE FROM states WHERE source = ? AND item = ?", [(source, item) for item in items]
            )

    def after(self, sequence: int, limit: int, selection: Selection = EVERYTHING) -> list[StoredEvent]:
        """Return up to `limit` selected events that follow this sequence, in order."""
        if not self.database.is_made:
            return []
        where, values = selection.where()
        sql = f"SELECT sequence, body FROM events WHERE {where} ORDER BY sequence LIMIT ?"
        return [StoredEvent(*row) for row in self.database.rows(sql, sequence, *values, limit)]

    def last(self, limit: int, selection: Selection = EVERYTHING) -> list[StoredEvent]:
        """Return the newest selected events, at most `limit`, in order."""
        if not self.database.is_made:
            return []
        where, values = selection.where()
        sql = f"SELECT sequence, body FROM events WHERE {where} ORDER BY sequence DESC LIMIT ?"
        return [StoredEvent(*row) for row in reversed(self.database.rows(sql, 0, *values, limit))]

    def prune(self, keep_from_ns: int, max_bytes: int) -> int:
        """Delete the oldest events and stays that are too old or too many, at most PRUNED. Return how many events.

        What is still queued of them is lost, and counted.
        """
        if not self.database.is_made:
            return 0
        oversized = self.database.used_bytes() > max_bytes
        condition = "1" if oversized else "t_ns < ?"
        values = [] if oversized else [keep_from_ns]
        with self.database.transaction() as connection:
            prune_stays(connection, None if oversized else keep_from_ns, PRUNED)
            end, end_ns = connection.execute(
                "SELECT max(sequence), max(t_ns) FROM "
                f"(SELECT sequence, t_ns FROM events ORDER BY sequence LIMIT {PRUNED}) WHERE {condition}",
                values,
            ).fetchone()
            prune_changes(connection, end_ns if oversized else keep_from_ns)
            if end is None:
                return 0
            prune_alarms(connection, end)
            self.dropped_deliveries += connection.execute(
                "DELETE FROM deliveries WHERE sequence <= ? AND dead IS NULL", (end,)
            ).rowcount
            connection.execute("DELETE FROM deliveries WHERE sequence <= ?", (end,))
            return connection.execute("DELETE FROM events WHERE sequence <= ?", (end,)).rowcount


def cloud_event(draft: Draft, sequence: int, site: str) -> bytes:
    """Return the CloudEvent as JSON."""
    return orjson.dumps(
        {
            "specversion": "1.0",
            "id": uuid.uuid4().hex,
            "source": f"urn:dropanchor:site:{site}",
            "type": draft.type.value,
            "subject": draft.tag,
            "time": rfc3339(draft.t_ns),
            "sequence": f"{sequence:020}",
            "datacontenttype": "application/json",
            "data": _UNKNOWN | dict(draft.data),
        }
    )


def rfc3339(t_ns: int) -> str:
    """Return the time in UTC, to the microsecond."""
    at = datetime.fromtimestamp(t_ns // 1_000_000_000, UTC).replace(microsecond=t_ns // 1000 % 1_000_000)
    return at.isoformat(timespec="microseconds").replace("+00:00", "Z")
