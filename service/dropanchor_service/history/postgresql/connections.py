"""Lend connections to threads, and keep them for the next one.

A pool of the package `psycopg_pool` has threads of its own, and reports a refused login only to the log.
"""

import select
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import BoundedSemaphore

from psycopg import Connection, OperationalError
from psycopg.pq import TransactionStatus

from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.postgresql.errors import explained

WAIT_S = 5.0


class Connections:
    """Lends up to `most` connections at once."""

    def __init__(self, connect: Callable[[], Connection], most: int) -> None:
        self._connect = connect
        self._free = BoundedSemaphore(most)
        self._idle: list[Connection] = []

    @contextmanager
    def lent(self) -> Iterator[Connection]:
        """Lend a connection. Raises HistoryError, also for errors of the database in this context."""
        if not self._free.acquire(timeout=WAIT_S):
            raise HistoryError("the database is busy with other requests: try again")
        try:
            with explained():
                connection = self._idle_one() or self._connect()
                try:
                    yield connection
                except OperationalError:
                    self.close()  # the others are no better, and each would be waited for
                    raise
                finally:
                    self._take_back(connection)
        finally:
            self._free.release()

    def close(self) -> None:
        """Close those that nobody uses."""
        while (connection := self._popped()) is not None:
            connection.close()

    def _idle_one(self) -> Connection | None:
        while (connection := self._popped()) is not None and _has_news(connection):
            connection.close()
        return connection

    def _popped(self) -> Connection | None:
        try:
            return self._idle.pop()
        except IndexError:
            return None

    def _take_back(self, connection: Connection) -> None:
        if connection.info.transaction_status == TransactionStatus.IDLE:
            self._idle.append(connection)
        else:
            connection.close()


def _has_news(connection: Connection) -> bool:
    """Return whether the server has sent something unasked, as it does when it stops."""
    poll = select.poll()
    poll.register(connection.fileno(), select.POLLIN)
    return bool(poll.poll(0))
