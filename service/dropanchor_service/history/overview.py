"""Read the tracks of many tags over a period of any length: their figures, and a few points of each.

A short period is read pose by pose, a longer one from the summaries. Where a summary is missing, or the period covers
only a part of its stretch, the next finer level and in the end the poses take its place.
"""

import sqlite3
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.bulk_reading import summaries_in, summaries_of_poses
from dropanchor_service.history.records import SLOT_NS
from dropanchor_service.history.summaries import (
    SUMMARY,
    TRACK_POINT,
    in_order,
    points_of,
    summary_per_tag,
    thinned,
)
from dropanchor_service.history.summary_table import COARSE, FINE, LENGTHS_NS

MAX_POSES = 200_000  # that are read one by one: a second of work
MAX_FINE = 300_000  # summaries of the fine level
MAX_POINTS = 200_000  # of all tags together
MAX_BYTES = 128 * 2**20  # of all summaries
MAX_TAG_SLOTS = 500_000  # tags times slots without summaries


class OverviewError(sqlite3.Error):
    """The period cannot be read in a short time yet."""


class TooMuchError(ValueError):
    """The period is too long for so many tags."""


@dataclass(frozen=True)
class Overview:
    """The tracks of some tags. names: by number. figures: one SUMMARY per tag. points: TRACK_POINT, in order."""

    names: dict[int, str]
    figures: Array
    points: Array


EMPTY = Overview({}, np.empty(0, SUMMARY), np.empty(0, TRACK_POINT))


def read_overview(
    connection: sqlite3.Connection, tags: Sequence[str] | None, from_ns: int, to_ns: int, max_points: int
) -> Overview:
    """Return the figures of each tag, and at most `max_points` points, between two times, both included.

    tags: None for all tags. Raises sqlite3.Error and TooMuchError.
    """
    every = dict(connection.execute("SELECT id, name FROM tags"))
    wanted = None if tags is None else set(tags)
    names = every if wanted is None else {number: name for number, name in every.items() if name in wanted}
    if not names:
        return EMPTY
    level = _level(len(names), to_ns - from_ns)
    reader = _Reader(connection, None if tags is None else sorted(names), len(names), single=level < FINE)
    summaries = in_order(np.concatenate([np.empty(0, SUMMARY), *reader.cover(level, from_ns, to_ns)]))
    allowed = min(max_points, max(2, MAX_POINTS // len(names)))
    points = thinned(points_of(summaries), allowed)
    return Overview(names, summary_per_tag(summaries), points)


def _level(tags: int, span_ns: int) -> int:
    """Return the finest level that is read in a short time; -1 for single poses."""
    if tags * span_ns <= MAX_POSES * 1_000_000_000:
        return -1
    return FINE if tags * span_ns <= MAX_FINE * LENGTHS_NS[FINE] else COARSE


class _Reader:
    def __init__(
        self, connection: sqlite3.Connection, tags: Sequence[int] | None, tag_count: int, single: bool
    ) -> None:
        """tags: their numbers, None for all. single: whether to give each pose, rather than a summary of each slot."""
        self._connection = connection
        self._tags = tags
        self._tag_count = tag_count
        self._single = single
        self._bytes = 0
        self._slots = 0

    def cover(self, level: int, from_ns: int, to_ns: int) -> Iterator[Array]:
        """Yield SUMMARY arrays of disjoint stretches that cover the time. Raises sqlite3.Error."""
        if from_ns > to_ns:
            return
        if level < FINE:
            yield from self._poses(from_ns, to_ns)
            return
        length = LENGTHS_NS[level]
        first, end = -(-from_ns // length), (to_ns + 1) // length
        blobs = self._blobs(level, first, end)
        yield summaries_in(list(blobs.values()), self._tags)
        covered_ns = from_ns
        for stretch in blobs:
            yield from self.cover(level - 1, covered_ns, stretch * length - 1)
            covered_ns = (stretch + 1) * length
        yield from self.cover(level - 1, covered_ns, to_ns)

    def _blobs(self, level: int, first: int, end: int) -> dict[int, bytes]:
        window = (level, first, end - 1)
        where = "FROM summaries WHERE level = ? AND stretch BETWEEN ? AND ?"
        self._bytes += self._connection.execute(f"SELECT total(length(tags)) {where}", window).fetchone()[0]
        if self._bytes > MAX_BYTES:
            raise TooMuchError("the period is too long for so many tags: name the tags, or choose a shorter period")
        return dict(self._connection.execute(f"SELECT stretch, tags {where} ORDER BY stretch", window))

    def _poses(self, from_ns: int, to_ns: int) -> Iterator[Array]:
        count = "SELECT count(*) FROM slots WHERE slot BETWEEN ? AND ?"
        self._slots += self._connection.execute(count, (from_ns // SLOT_NS, to_ns // SLOT_NS)).fetchone()[0]
        if self._slots * self._tag_count > MAX_TAG_SLOTS:
            raise OverviewError("the summary of the history is still being made: try again in a few minutes")
        for poses in summaries_of_poses(self._connection, from_ns, to_ns, self._tags):
            yield poses if self._single else summary_per_tag(in_order(poses))
