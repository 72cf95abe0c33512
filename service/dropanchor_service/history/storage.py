"""What keeps the tracks of a site: a file, or a database."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.reader import TrackReader
from dropanchor_service.store.decimation import Decimation


@dataclass(frozen=True)
class Retention:
    """Which poses are kept, and for how long. HistorySettings explains each limit."""

    period_ns: int
    distance_m: float
    still_ns: int
    keep_ns: int
    max_bytes: int

    def decimation(self) -> Decimation:
        """Return what selects these poses, before the first one."""
        return Decimation(self.period_ns, self.distance_m, self.still_ns)


@dataclass
class Usage:
    """The space that a history takes. Sites that share a database share one of these."""

    bytes: int = 0


class Storage(Protocol):
    """Keeps the tracks of a site. One thread writes; `reader` reads from any thread. waits_for: the slow part."""

    waits_for: str

    @property
    def reader(self) -> TrackReader: ...

    @property
    def usage(self) -> Usage: ...

    @property
    def damaged(self) -> Sequence[str]:
        """Names of damaged files that were set aside."""

    def write(self, poses: Array, tags: Sequence[str], anchors: Sequence[str | None]) -> None:
        """Store poses, delete what is too old, and write some summaries.

        poses: POSE. tags, anchors: the names for each pose. The caller tries again after OSError and sqlite3.Error.
        """

    def close(self) -> None:
        """Give up what `write` has opened."""
