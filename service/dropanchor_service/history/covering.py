"""Find what covers a period: the stored stretches of time, and single poses where a stretch is missing or too long."""

from collections.abc import Iterator
from dataclasses import dataclass

from dropanchor_service.history.errors import TooMuchError, UnfinishedSummaryError
from dropanchor_service.history.stored import Kind, StoredTracks
from dropanchor_service.history.summary_table import FINE, LENGTHS_NS

MAX_BYTES = 128 * 2**20  # of all stretches
MAX_TAG_SLOTS = 500_000  # tags times slots that no stretch covers


@dataclass(frozen=True)
class Window:
    """A time, both ends included, that is read pose by pose."""

    from_ns: int
    to_ns: int


class Cover:
    """Covers one period, and refuses what would take too long."""

    def __init__(self, stored: StoredTracks, kind: Kind, tag_count: int) -> None:
        """kind: of the blobs. tag_count: of the tags that are read."""
        self._stored = stored
        self._kind = kind
        self._tag_count = tag_count
        self._bytes = 0
        self._slots = 0

    def pieces(self, level: int, from_ns: int, to_ns: int) -> Iterator[list[tuple[bytes, ...]] | Window]:
        """Yield disjoint pieces: the blobs of stretches of this level or a finer one, or windows of single poses.

        Raises the errors of `StoredTracks`, UnfinishedSummaryError and TooMuchError.
        """
        if from_ns > to_ns:
            return
        if level < FINE:
            yield self._window(from_ns, to_ns)
            return
        length = LENGTHS_NS[level]
        stretches = self._stretches(level, range(-(-from_ns // length), (to_ns + 1) // length))
        yield list(stretches.values())
        covered_ns = from_ns
        for stretch in stretches:
            yield from self.pieces(level - 1, covered_ns, stretch * length - 1)
            covered_ns = (stretch + 1) * length
        yield from self.pieces(level - 1, covered_ns, to_ns)

    def _stretches(self, level: int, stretches: range) -> dict[int, tuple[bytes, ...]]:
        self._bytes += self._stored.stretch_bytes(self._kind, level, stretches)
        if self._bytes > MAX_BYTES:
            raise TooMuchError("the period is too long for so many tags: name the tags, or choose a shorter period")
        return self._stored.stretches(self._kind, level, stretches)

    def _window(self, from_ns: int, to_ns: int) -> Window:
        self._slots += self._stored.count_slots(from_ns, to_ns)
        if self._slots * self._tag_count > MAX_TAG_SLOTS:
            raise UnfinishedSummaryError("the summary of the history is still being made: try again in a few minutes")
        return Window(from_ns, to_ns)
