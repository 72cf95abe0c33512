"""Write poses and summaries of a site into the database."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from psycopg import Connection

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.postgresql.database import Database
from dropanchor_service.history.postgresql.days import DAY_NS, make_days
from dropanchor_service.history.postgresql.insertion import Insertion
from dropanchor_service.history.postgresql.rows import PostgresqlRows
from dropanchor_service.history.postgresql.schema import lock
from dropanchor_service.history.records import SLOT_NS
from dropanchor_service.history.storage import Retention
from dropanchor_service.history.summary_table import SummaryTable

_SITE = """
INSERT INTO sites (name, keep_ns, max_bytes) VALUES (%s, %s, %s)
ON CONFLICT (name) DO UPDATE SET keep_ns = excluded.keep_ns, max_bytes = excluded.max_bytes RETURNING id
"""


class DatabaseWriter:
    """Writes one site. Other services may write it too. Every method raises HistoryError and then has changed nothing.

    epoch_of: returns the epoch in which this service owns the site. Where two services have written a tag, readers take
    the later owner's poses from its first pose on.
    """

    def __init__(
        self, database: Database, site: str, retention: Retention, epoch_of: Callable[[], int] = lambda: 0
    ) -> None:
        self._database = database
        self._site = site
        self._limits = (retention.keep_ns, retention.max_bytes)
        self._epoch_of = epoch_of
        self._insertion: Insertion | None = None
        self._summaries: SummaryTable | None = None

    def close(self) -> None:
        self._database.close()

    def insert(self, poses: Array, tags: Sequence[str], anchors: Sequence[str | None]) -> None:
        """Insert poses, and replace poses of the same tag, time and epoch.

        poses: POSE. tags, anchors: the names for each pose.
        """
        with self._connected() as (connection, insertion):
            make_days(connection, np.unique(poses["t_ns"] // DAY_NS).tolist())
            with self._site_locked(connection, insertion.site) as (rows, summaries):
                superseded_ns = insertion.insert(connection, poses, tags, anchors)
                if superseded_ns is not None:
                    rows.delete_stretches_from(superseded_ns)
                    summaries.reload(rows)
                summaries.delete(rows, np.unique(poses["t_ns"] // SLOT_NS))

    def summarise(self, most_s: float = 0.0) -> bool:
        """Write missing summaries for so long, at least one. Return whether there may be more."""
        end_s = time.monotonic() + most_s
        with self._connected() as (connection, insertion), self._site_locked(connection, insertion.site) as locked:
            rows, summaries = locked
            while summaries.write_next(rows):
                if time.monotonic() >= end_s:
                    return True
        return False

    @contextmanager
    def _connected(self) -> Iterator[tuple[Connection, Insertion]]:
        """Lend a connection, and what is known of the site. After an error all of it is read again."""
        try:
            with self._database.writing() as connection:
                if self._insertion is None:
                    self._insertion = Insertion(self._site_number(connection), self._epoch_of())
                yield connection, self._insertion
        except BaseException:
            self._insertion = self._summaries = None
            raise

    def _site_number(self, connection: Connection) -> int:
        """Return the number of the site, after its limits were stored for all services that use the database."""
        found = connection.execute(_SITE, (self._site, *self._limits)).fetchone()
        assert found is not None
        return int(found[0])

    @contextmanager
    def _site_locked(self, connection: Connection, site: int) -> Iterator[tuple[PostgresqlRows, SummaryTable]]:
        """Open a transaction in which no other service writes the site, so that no summary can lack a pose."""
        rows = PostgresqlRows(connection, site, self._epoch_of())
        with connection.transaction():
            lock(connection, site)
            if self._summaries is None:
                self._summaries = SummaryTable(rows)
            else:
                self._summaries.reload(rows)
            yield rows, self._summaries
