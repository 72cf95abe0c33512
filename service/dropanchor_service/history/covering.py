"""Find what covers a period: the stored stretches of time, and single poses where a stretch is missing or too long."""

import sqlite3
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from dropanchor_service.history.records import SLOT_NS
from dropanchor_service.history.summary_table import FINE, LENGTHS_NS

MAX_BYTES = 128 * 2**20  # of all stretches
MAX_TAG_SLOTS = 500_000  # tags times slots that no stretch covers


class UnfinishedSummaryError(sqlite3.Error):
    """The period cannot be read in a short time yet."""


class TooMuchError(ValueError):
    """The period is too long for so many tags."""


@dataclass(frozen=True)
class Window:
    """A time, both ends included, that is read pose by pose."""

    from_ns: int
    to_ns: int


class Cover:
    """Covers one period, and refuses what would take too long."""

    def __init__(self, connection: sqlite3.Connection, table: str, blobs: Sequence[str], tag_count: int) -> None:
        """table: holds the stretches. blobs: its columns. tag_count: of the tags that are read."""
        self._connection = connection
        self._table = table
        self._blobs = blobs
        self._tag_count = tag_count
        self._bytes = 0
        self._slots = 0

    def pieces(self, level: int, from_ns: int, to_ns: int) -> Iterator[list[tuple[bytes, ...]] | Window]:
        """Yield disjoint pieces: the blobs of stretches of this level or a finer one, or windows of single poses.

        Raises sqlite3.Error and TooMuchError.
        """
        if from_ns > to_ns:
            return
        if level < FINE:
            yield self._window(from_ns, to_ns)
            return
        length = LENGTHS_NS[level]
        stretches = self._stretches(level, -(-from_ns // length), (to_ns + 1) // length)
        yield list(stretches.values())
        covered_ns = from_ns
        for stretch in stretches:
            yield from self.pieces(level - 1, covered_ns, stretch * length - 1)
            covered_ns = (stretch + 1) * length
        yield from self.pieces(level - 1, covered_ns, to_ns)

    def _stretches(self, level: int, first: int, end: int) -> dict[int, tuple[bytes, ...]]:
        window = (level, first, end - 1)
        where = f"FROM {self._table} WHERE level = ? AND stretch BETWEEN ? AND ?"
        size = " + ".join(f"length({blob})" for blob in self._blobs)
        self._bytes += self._connection.execute(f"SELECT total({size}) {where}", window).fetchone()[0]
        if self._bytes > MAX_BYTES:
            raise TooMuchError("the period is too long for so many tags: name the tags, or choose a shorter period")
        sql = f"SELECT stretch, {', '.join(self._blobs)} {where} ORDER BY stretch"
        return {row[0]: row[1:] for row in self._connection.execute(sql, window)}

    def _window(self, from_ns: int, to_ns: int) -> Window:
        count = "SELECT count(*) FROM slots WHERE slot BETWEEN ? AND ?"
        self._slots += self._connection.execute(count, (from_ns // SLOT_NS, to_ns // SLOT_NS)).fetchone()[0]
        if self._slots * self._tag_count > MAX_TAG_SLOTS:
            raise UnfinishedSummaryError("the summary of the history is still being made: try again in a few minutes")
        return Window(from_ns, to_ns)
