"""What a kind of storage offers to those who read and summarise tracks.

Each method raises the error of its database. A `TrackReader` makes a HistoryError of it.
"""

from collections.abc import Iterator, Sequence
from typing import Literal, Protocol

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.records import StoredPoses

Kind = Literal["summaries", "heat"]
"""Blobs of a stretch of time: (SUMMARY records) or (HEAD records, CELL records)."""


class StoredTracks(Protocol):
    """The stored tracks of a site at one moment. Periods include both ends."""

    def tag_names(self) -> dict[int, str]:
        """Return all tags of which a pose was ever stored, by number."""

    def has_tag(self, tag: str) -> bool:
        """Return whether a pose of this tag was ever stored."""

    def span(self) -> tuple[int, int] | None:
        """Return the time that the poses cover, ns; None without poses."""

    def poses(self, tag: str, from_ns: int, to_ns: int, limit: int, newest_first: bool) -> StoredPoses:
        """Return up to `limit` poses of a tag."""

    def summaries_of_poses(self, from_ns: int, to_ns: int, tags: Sequence[int] | None) -> Iterator[Array]:
        """Yield the SUMMARY of every single pose, for one short stretch of time after another. tags: None for all."""

    def count_slots(self, from_ns: int, to_ns: int) -> int:
        """Return how many slots of the period have poses."""

    def filled_parts(self, first_slot: int, slots: int, count: int) -> list[int]:
        """Return the parts with poses, counted from 0, in order. There are `count` parts of so many slots."""

    def stretch_bytes(self, kind: Kind, level: int, stretches: range) -> int:
        """Return the size of what `stretches` returns."""

    def stretches(self, kind: Kind, level: int, stretches: range) -> dict[int, tuple[bytes, ...]]:
        """Return the blobs of these stretches, in order. Those that are not written are missing."""


class WritableTracks(StoredTracks, Protocol):
    """The same within a transaction that may write summaries."""

    def newest_slot(self) -> int | None:
        """Return the newest slot with poses."""

    def missing_stretches(self, level: int) -> set[int]:
        """Return the stretches with poses whose blobs are not written."""

    def put_stretch(self, level: int, stretch: int, summaries: bytes | None, heads: bytes, cells: bytes) -> None:
        """Write the blobs of a stretch."""

    def delete_stretches(self, level: int, stretches: Sequence[int]) -> None:
        """Delete the blobs of these stretches."""
