"""Recognise a pooler that lends a connection of the database for one transaction at a time, such as PgBouncer.

Settings of a session, such as the search path and the time limits, and prepared statements get lost or mixed up there.
"""

from collections.abc import Callable
from contextlib import closing
from typing import Any

from psycopg import Connection

from dropanchor_service.history.errors import HistoryError

_PROCESS = "SELECT pg_backend_pid()"


def refuse_transaction_pooler(connection: "Connection[Any]", connect: Callable[[], "Connection[Any]"]) -> None:
    """Raise HistoryError if another connection can take over the process that serves this one."""
    process = _process_of(connection)
    if process == connection.info.backend_pid:
        return  # without a pooler
    with closing(connect()) as other, other.transaction():
        is_lent = _process_of(other) == process
    if is_lent or _process_of(connection) != process:
        raise HistoryError(
            "the pooler before the database lends its connections by transaction, which loses the settings of a "
            "session: set pool_mode = session for this database, or give the address of the database itself in `url`"
        )


def _process_of(connection: "Connection[Any]") -> int:
    found = connection.execute(_PROCESS).fetchone()
    assert found is not None
    return int(found[0])
