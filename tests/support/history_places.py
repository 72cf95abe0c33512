"""Where the tests of the history store poses: a SQLite file, or a site of a PostgreSQL database."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Protocol

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.postgresql.database import Database
from dropanchor_service.history.postgresql.store import DatabaseReader
from dropanchor_service.history.postgresql.writer import DatabaseWriter
from dropanchor_service.history.reader import TrackReader
from dropanchor_service.history.sqlite.track_file import FileReader, TrackWriter
from dropanchor_service.history.storage import Retention
from dropanchor_service.history.stored import Kind
from dropanchor_service.history.summary_table import LENGTHS_NS

KEEP_ALL = Retention(1_000_000_000, 0.1, 5_000_000_000, 2**62, 2**62)
_numbers = count()


class Writer(Protocol):
    """What both kinds of writers can do."""

    def insert(self, poses: Array, tags: Sequence[str], anchors: Sequence[str | None]) -> None: ...

    def summarise(self) -> bool: ...

    def close(self) -> None: ...


class Place(Protocol):
    """Opens the history of a site as often as a test wants."""

    @property
    def reader(self) -> TrackReader: ...

    def writer(self) -> Writer: ...


@dataclass
class FilePlace:
    """The history in a file."""

    path: Path

    @property
    def reader(self) -> FileReader:
        return FileReader(self.path)

    def writer(self) -> TrackWriter:
        return TrackWriter(self.path)


class _PatientWriter(DatabaseWriter):
    """Writes all summaries that it can in one transaction."""

    def summarise(self, most_s: float = 60.0) -> bool:
        return super().summarise(most_s)


@dataclass
class DatabasePlace:
    """The history of a site in a database. Each place is another site, unless it has a name."""

    database: Database
    site: str = field(default_factory=lambda: f"site {next(_numbers)}")
    retention: Retention = KEEP_ALL

    @property
    def reader(self) -> DatabaseReader:
        return DatabaseReader(self.database, self.site)

    def writer(self, epoch: int = 0) -> DatabaseWriter:
        return _PatientWriter(self.database, self.site, self.retention, lambda: epoch)


@contextmanager
def opened(url: str, now_ns: int = 0) -> Iterator[Database]:
    """Open a database, and close its connections in the end."""
    database = Database(url, None, lambda: now_ns)
    try:
        yield database
    finally:
        database.close()


def count_written(place: Place, kind: Kind, level: int, from_ns: int, to_ns: int) -> int:
    """Return how many stretches of a level are written in a period."""
    with place.reader.snapshot() as stored:
        assert stored is not None
        length = LENGTHS_NS[level]
        return len(stored.stretches(kind, level, range(from_ns // length, to_ns // length + 1)))
