"""The trail of changes: who changed what, and what it was before. It is in the file of the events, and kept as long.

An entry is written before the change is made, and confirmed afterwards. So a change that was acknowledged has one,
whenever the service is killed; one that is not confirmed may not have happened.
"""

import logging
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import orjson
from pydantic import BaseModel

from dropanchor_service.events.database import Database
from dropanchor_service.store.trail import SERVICE, WHO, Change

MOST_AT_ONCE = 1000  # that are deleted in one transaction to make room
_COLUMNS = "number, t_ns, source, name, kind, item, before, after, confirmed"

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Wanted:
    """Which entries. before: only those with a lower number. kinds: None for all."""

    from_ns: int = 0
    to_ns: int = 2**62
    kinds: Sequence[str] | None = None
    item: str | None = None
    before: int = 2**62


class ChangeTrail:
    """Any thread may use it."""

    def __init__(self, database: Database, now_ns: Callable[[], int]) -> None:
        self._database = database
        self._now_ns = now_ns

    @contextmanager
    def changing(self, change: Change) -> Iterator[Change]:
        """Note a change that is made in this context; see `Trail`."""
        if change.is_none:
            yield change
            return
        number = self._begin(change)
        try:
            yield change
        except BaseException:
            with suppress(sqlite3.Error):  # it stays unconfirmed then
                self._execute("DELETE FROM changes WHERE number = ?", number)
            raise
        self._confirm(number, change)

    def _begin(self, change: Change) -> int:
        who = WHO.get(SERVICE)
        values = (
            self._now_ns(),
            *who,
            change.kind,
            change.item,
            _json(change, change.before),
            _json(change, change.after),
        )
        try:
            return self._execute(
                "INSERT INTO changes (t_ns, source, name, kind, item, before, after) VALUES (?, ?, ?, ?, ?, ?, ?)",
                *values,
            )
        except sqlite3.Error as error:
            raise OSError(f"the trail of changes cannot be written ({error})") from error

    def _confirm(self, number: int, change: Change) -> None:
        _log.info("%s %r was changed by %s", change.kind, change.item, " ".join(filter(None, WHO.get(SERVICE))))
        try:
            self._execute(
                "UPDATE changes SET confirmed = 1, item = ?, after = ? WHERE number = ?",
                *(change.item, _json(change, change.after), number),
            )
        except sqlite3.Error as error:  # the change is made, and its entry is there
            _log.error("the change of %s %r cannot be confirmed in the trail: %s", change.kind, change.item, error)

    def _execute(self, sql: str, *values: Any) -> int:
        with self._database.transaction() as connection:
            return connection.execute(sql, values).lastrowid or 0

    def entries(self, wanted: Wanted, limit: int) -> list[dict[str, Any]]:
        """Return the `AuditEntry` of the newest changes. Raises sqlite3.Error."""
        if not self._database.is_made:
            return []
        where, values = ["t_ns BETWEEN ? AND ?", "number < ?"], list[Any]([wanted.from_ns, wanted.to_ns, wanted.before])
        if wanted.kinds is not None:
            where.append("kind IN (SELECT value FROM json_each(?))")
            values.append(orjson.dumps(wanted.kinds).decode())
        if wanted.item is not None:
            where.append("item = ?")
            values.append(wanted.item)
        sql = f"SELECT {_COLUMNS} FROM changes WHERE {' AND '.join(where)} ORDER BY number DESC LIMIT ?"
        return [_entry(*row) for row in self._database.rows(sql, *values, limit)]


def prune_changes(connection: sqlite3.Connection, keep_from_ns: int | None) -> None:
    """Delete the changes from before this time. None: the oldest, to make room where there are no events to delete."""
    if keep_from_ns is None:
        connection.execute(
            f"DELETE FROM changes WHERE number IN (SELECT number FROM changes ORDER BY number LIMIT {MOST_AT_ONCE})"
        )
    else:
        connection.execute("DELETE FROM changes WHERE t_ns < ?", (keep_from_ns,))


def _json(change: Change, value: BaseModel | None) -> str | None:
    return None if value is None else change.shown(value).model_dump_json()


def _entry(
    number: int,
    t_ns: int,
    source: str,
    name: str,
    kind: str,
    item: str,
    before: str | None,
    after: str | None,
    confirmed: int,
) -> dict[str, Any]:
    return {
        "number": number,
        "t_ns": t_ns,
        "by": {"source": source, "name": name},
        "kind": kind,
        "item": item,
        "before": None if before is None else orjson.Fragment(before),
        "after": None if after is None else orjson.Fragment(after),
        "confirmed": bool(confirmed),
    }
