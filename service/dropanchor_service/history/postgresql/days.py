"""The partitions of the database: one for each day of each large table, made with its first pose and dropped whole."""

import calendar
import time
from collections.abc import Iterable

from psycopg import Connection
from psycopg.sql import SQL, Identifier, Literal

from dropanchor_service.history.postgresql.schema import SCHEMA, lock
from dropanchor_service.history.summary_table import DAY, LENGTHS_NS

DAY_NS = LENGTHS_NS[DAY]
_TABLES = ("poses", "slots", "stretches")
_DAYS = "SELECT substr(relname, 7) FROM pg_class WHERE relnamespace = %s::regnamespace AND relname ~ '^poses_[0-9]{8}$'"
_SIZE = "SELECT sum(pg_total_relation_size(oid)) FROM pg_class WHERE relnamespace = %s::regnamespace AND relkind = 'r'"
_ATTACH = "ALTER TABLE {table} ATTACH PARTITION {part} FOR VALUES FROM ({start}) TO ({end})"


def make_days(connection: Connection, days: Iterable[int]) -> None:
    """Make the partitions of these days, counted from 1970, unless they exist."""
    new = set(days).difference(existing_days(connection))
    if not new:
        return
    with connection.transaction():
        lock(connection, 0)
        for day in new.difference(existing_days(connection)):
            for table in _TABLES:
                parts = {"table": Identifier(table), "part": Identifier(_part(table, day))}
                # A table that is attached later blocks no reader, unlike one that is made as a partition.
                connection.execute(SQL("CREATE TABLE {part} (LIKE {table} INCLUDING ALL)").format(**parts))
                limits = {"start": Literal(day * DAY_NS), "end": Literal((day + 1) * DAY_NS)}
                connection.execute(SQL(_ATTACH).format(**parts, **limits))


def drop_day(connection: Connection, day: int) -> None:
    """Drop all that is stored of a day, of all sites."""
    with connection.transaction():
        lock(connection, 0)
        for table in _TABLES:
            connection.execute(SQL("DROP TABLE IF EXISTS {}").format(Identifier(_part(table, day))))
        limits = (day * DAY_NS, (day + 1) * DAY_NS)
        connection.execute("DELETE FROM missing WHERE from_ns >= %s AND from_ns < %s", limits)


def existing_days(connection: Connection) -> list[int]:
    """Return the days with partitions, the oldest first."""
    return sorted(_day(name) for (name,) in connection.execute(_DAYS, (SCHEMA,)))


def used_bytes(connection: Connection) -> int:
    """Return the size of all tables with their indexes."""
    found = connection.execute(_SIZE, (SCHEMA,)).fetchone()
    return 0 if found is None or found[0] is None else int(found[0])


def _part(table: str, day: int) -> str:
    return f"{table}_{time.strftime('%Y%m%d', time.gmtime(day * 86_400))}"


def _day(text: str) -> int:
    """Return the number of a day such as 20270115."""
    return calendar.timegm(time.strptime(text, "%Y%m%d")) // 86_400
