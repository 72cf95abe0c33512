"""Keep the tracks of a site in the database."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.postgresql.database import Database
from dropanchor_service.history.postgresql.days import DAY_NS
from dropanchor_service.history.postgresql.rows import PostgresqlRows
from dropanchor_service.history.postgresql.writer import DatabaseWriter
from dropanchor_service.history.reader import TrackReader
from dropanchor_service.history.storage import Retention, Usage

MAX_SUMMARISE_S = 0.2  # per write


class DatabaseReader(TrackReader):
    """Reads the tracks of one site."""

    def __init__(self, database: Database, site: str) -> None:
        self._database = database
        self._site = site

    @contextmanager
    def snapshot(self) -> Iterator[PostgresqlRows | None]:
        """Return the tracks at this moment; None while none of the site are stored. Raises HistoryError."""
        with self._database.reading() as connection:
            found = None
            if connection is not None:
                found = connection.execute("SELECT id FROM sites WHERE name = %s", (self._site,)).fetchone()
            yield PostgresqlRows(connection, found[0]) if connection is not None and found is not None else None


class PostgresqlStorage:
    """The `Storage` of a site in a database. `write` raises HistoryError, and may then have stored a part.

    epoch_of: as for `DatabaseWriter`.
    """

    damaged: Sequence[str] = ()
    waits_for = "the database"

    def __init__(
        self,
        database: Database,
        site: str,
        retention: Retention,
        now_ns: Callable[[], int],
        epoch_of: Callable[[], int] = lambda: 0,
    ) -> None:
        self._database = database
        self._keep_ns = retention.keep_ns
        self._now_ns = now_ns
        self._writer = DatabaseWriter(database, site, retention, epoch_of)
        self.reader = DatabaseReader(database, site)

    @property
    def usage(self) -> Usage:
        return self._database.usage

    def close(self) -> None:
        self._writer.close()

    def write(self, poses: Array, tags: Sequence[str], anchors: Sequence[str | None]) -> None:
        oldest_ns = (self._now_ns() - self._keep_ns) // DAY_NS * DAY_NS
        kept = np.flatnonzero(poses["t_ns"] >= oldest_ns).tolist()
        if kept:
            self._writer.insert(poses[kept], [tags[place] for place in kept], [anchors[place] for place in kept])
        self._writer.summarise(MAX_SUMMARISE_S)
        self._database.maintain()
