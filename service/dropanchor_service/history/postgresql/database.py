"""The database that keeps the history of all sites of a service: its connections, its days and its size."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from threading import Event, Lock
from typing import Any

import psycopg
from psycopg import Connection
from psycopg.conninfo import conninfo_to_dict, make_conninfo

from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.postgresql.connections import Connections
from dropanchor_service.history.postgresql.days import DAY_NS, drop_day, existing_days, used_bytes
from dropanchor_service.history.postgresql.errors import sentence
from dropanchor_service.history.postgresql.patience import PatientConnection
from dropanchor_service.history.postgresql.pooler import refuse_transaction_pooler
from dropanchor_service.history.postgresql.schema import SCHEMA, prepare, require_current
from dropanchor_service.history.storage import Usage

MOST_WRITING, MOST_READING = 2, 4  # connections of a service
MAINTAIN_S = 60.0
LOCK_TIMEOUT = "5s"
READ_S = 12.0  # for a statement that somebody waits for
AWAY_S = 10.0  # for so long readers take the last refusal for theirs, unless the writer connects
_DEFAULTS = {
    "application_name": "dropanchor",
    "connect_timeout": 5,
    "tcp_user_timeout": 15_000,
    "keepalives_idle": 15,
    "keepalives_interval": 5,
    "keepalives_count": 3,
}
# A parallel query or one compiled for its rows would take longer, and the arrays of `pose_columns` need one order.
_SESSION = f"""
SET search_path = {SCHEMA}; SET TimeZone = UTC; SET jit = off; SET max_parallel_workers_per_gather = 0;
SET statement_timeout = '60s'; SET lock_timeout =
"""
_LIMITS = "SELECT (extract(epoch FROM now()) * 1e9)::bigint, max(keep_ns), max(max_bytes) FROM sites"
_SHORTER = "SELECT id, keep_ns FROM sites WHERE keep_ns < (SELECT max(keep_ns) FROM sites)"


class NoHistoryYetError(HistoryError):
    """No service has written a history into the database yet."""


class Database:
    """Any thread may use it. Every method raises HistoryError."""

    def __init__(self, url: str, password_file: Path | None, now_ns: Callable[[], int]) -> None:
        """Raise HistoryError if the URL has something that PostgreSQL does not know. Nothing connects yet."""
        try:
            self._parameters: dict[str, Any] = _DEFAULTS | conninfo_to_dict(url)
        except psycopg.Error as error:
            raise HistoryError(str(error).strip()) from error
        self._password_file = password_file
        self._now_ns = now_ns
        self._writing = Connections(self._connect_to_write, MOST_WRITING)
        self._reading = Connections(self._connect_to_read, MOST_READING)
        self._away: tuple[float, str] | None = (
            None  # when no connection could be made or the server fell silent, and why
        )
        self._stops = Event()
        self._maintaining = Lock()
        self._maintained_s = -MAINTAIN_S
        self.usage = Usage()

    def writing(self) -> AbstractContextManager[Connection]:
        """Lend a connection that writes."""
        return self._writing.lent()

    @contextmanager
    def reading(self) -> Iterator[Connection | None]:
        """Lend a connection in a transaction that sees one state of all tables; None before anything was written."""
        try:
            with self._reading.lent() as connection, connection.transaction():
                connection.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY")
                yield connection
        except NoHistoryYetError:
            yield None

    def stop_reading(self) -> None:
        """Let nobody who reads wait any longer: the service stops."""
        self._stops.set()

    def close(self) -> None:
        """Close the connections that nobody uses."""
        self._writing.close()
        self._reading.close()

    def maintain(self) -> None:
        """Drop the days that are too old or too many, once a minute."""
        with self._maintaining:
            if time.monotonic() - self._maintained_s < MAINTAIN_S:
                return
            with self.writing() as connection, suppress(psycopg.errors.LockNotAvailable):
                self._maintain(connection)  # a minute later is early enough where somebody reads for long
            self._maintained_s = time.monotonic()

    def _maintain(self, connection: Connection) -> None:
        found = connection.execute(_LIMITS).fetchone()
        assert found is not None
        server_ns, keep_ns, max_bytes = found
        now_ns = min(self._now_ns(), server_ns)  # a service whose clock is ahead must not drop what others keep
        days = existing_days(connection)
        while days and (days[0] + 1) * DAY_NS <= now_ns - keep_ns:
            drop_day(connection, days.pop(0))
        self.usage.bytes = used_bytes(connection)
        while len(days) > 1 and self.usage.bytes > max_bytes:
            drop_day(connection, days.pop(0))
            self.usage.bytes = used_bytes(connection)
        for site, keep_ns in connection.execute(_SHORTER).fetchall():
            _delete(connection, site, (now_ns - keep_ns) // DAY_NS * DAY_NS)

    def _connect_to_write(self) -> Connection:
        connection = self._connect()
        try:
            refuse_transaction_pooler(connection, self._connect)
            prepare(connection)
        except BaseException:
            connection.close()
            raise
        return connection

    def _connect_to_read(self) -> Connection:
        self._refuse_while_away()
        connection = self._connect()
        connection.silence_s, connection.give_up = READ_S + 2.0, self._stops
        try:
            connection.execute(f"SET statement_timeout = '{READ_S:.0f}s'")
            if not require_current(connection):
                raise NoHistoryYetError
        except BaseException:
            connection.close()
            raise
        return connection

    def _refuse_while_away(self) -> None:
        if self._away is not None and time.monotonic() - self._away[0] < AWAY_S:
            raise HistoryError(self._away[1])  # the writer tries: who answers current poses must not wait for it

    def _connect(self) -> PatientConnection:
        password = {} if self._password_file is None else {"password": _password_in(self._password_file)}
        try:
            connection = PatientConnection.connect(make_conninfo(**self._parameters | password), autocommit=True)
        except psycopg.Error as error:
            self._away = (time.monotonic(), sentence(error))
            raise
        self._away = None
        connection.execute(f"{_SESSION} '{LOCK_TIMEOUT}'")
        return connection


def _delete(connection: Connection, site: int, before_ns: int) -> None:
    """Delete what is stored of a site before a time, of days that are kept for other sites."""
    some = "SELECT 1 FROM slots WHERE site = %s AND t_ns < %s LIMIT 1"
    if connection.execute(some, (site, before_ns)).fetchone() is None:
        return
    with connection.transaction():
        for table, column in {"poses": "t_ns", "slots": "t_ns", "stretches": "from_ns", "missing": "from_ns"}.items():
            connection.execute(f"DELETE FROM {table} WHERE site = %s AND {column} < %s", (site, before_ns))


def _password_in(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise HistoryError(f"the password file {file} cannot be read: {error}") from error
