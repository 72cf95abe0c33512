"""Read the stored tracks of a site, wherever they are stored."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import AbstractContextManager

from dropanchor_service.history.coverage import NO_COVERAGE, Coverage, read_coverage
from dropanchor_service.history.heat_cells import NO_HEAT
from dropanchor_service.history.heat_map import HeatMap, heat_map_of, read_heat_map
from dropanchor_service.history.overview import EMPTY, Overview, read_overview
from dropanchor_service.history.records import NO_POSES, StoredPoses
from dropanchor_service.history.stored import StoredTracks


class TrackReader(ABC):
    """Reads from any thread. Every method raises HistoryError."""

    @abstractmethod
    def snapshot(self) -> AbstractContextManager[StoredTracks | None]:
        """Return the tracks at this moment, for a short time; None while nothing is stored."""

    def poses(self, tag: str, from_ns: int, to_ns: int, limit: int, newest_first: bool = False) -> StoredPoses:
        """Return up to `limit` poses between the two times, both included."""
        with self.snapshot() as stored:
            return NO_POSES if stored is None else stored.poses(tag, from_ns, to_ns, limit, newest_first)

    def overview(self, tags: Sequence[str] | None, from_ns: int, to_ns: int, max_points: int) -> Overview:
        """Return the figures of these tags, or of all, and at most `max_points` points of each.

        Raises TooMuchError too.
        """
        with self.snapshot() as stored:
            return EMPTY if stored is None else read_overview(stored, tags, from_ns, to_ns, max_points)

    def heat_map(self, tags: Sequence[str] | None, from_ns: int, to_ns: int, cell_m: float) -> HeatMap:
        """Return where these tags, or all, were, in squares of at least `cell_m`.

        Raises TooMuchError too.
        """
        with self.snapshot() as stored:
            if stored is None:
                return heat_map_of(NO_HEAT, cell_m)
            return read_heat_map(stored, tags, from_ns, to_ns, cell_m)

    def tags(self) -> list[str]:
        """Return all tags of which a pose was ever stored."""
        with self.snapshot() as stored:
            return [] if stored is None else list(stored.tag_names().values())

    def span(self) -> tuple[int, int] | None:
        """Return the time that the stored poses cover, ns; None without poses."""
        with self.snapshot() as stored:
            return None if stored is None else stored.span()

    def coverage(self, from_ns: int, to_ns: int, max_parts: int) -> Coverage:
        """Return when there are poses between the two times, in at most `max_parts` equal parts."""
        with self.snapshot() as stored:
            return NO_COVERAGE if stored is None else read_coverage(stored, from_ns, to_ns, max_parts)

    def has_tag(self, tag: str) -> bool:
        """Return whether a pose of this tag was ever stored."""
        with self.snapshot() as stored:
            return stored is not None and stored.has_tag(tag)
