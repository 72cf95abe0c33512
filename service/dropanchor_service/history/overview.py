"""Read the tracks of many tags over a period of any length: their figures, and a few points of each.

A short period is read pose by pose, a longer one from the summaries. Where a summary is missing, or the period covers
only a part of its stretch, the next finer level and in the end the poses take its place.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.covering import Cover, Window
from dropanchor_service.history.stored import StoredTracks
from dropanchor_service.history.summaries import (
    SUMMARY,
    TRACK_POINT,
    in_order,
    points_of,
    summaries_in,
    summary_per_tag,
    thinned,
)
from dropanchor_service.history.summary_table import COARSE, FINE, LENGTHS_NS

MAX_POSES = 200_000  # that are read one by one: a second of work
MAX_FINE = 300_000  # summaries of the fine level
MAX_POINTS = 200_000  # of all tags together


@dataclass(frozen=True)
class Overview:
    """The tracks of some tags. names: by number. figures: one SUMMARY per tag. points: TRACK_POINT, in order."""

    names: dict[int, str]
    figures: Array
    points: Array


EMPTY = Overview({}, np.empty(0, SUMMARY), np.empty(0, TRACK_POINT))


def read_overview(
    stored: StoredTracks, tags: Sequence[str] | None, from_ns: int, to_ns: int, max_points: int
) -> Overview:
    """Return the figures of each tag, and at most `max_points` points, between two times, both included.

    tags: None for all tags. Raises the errors of `StoredTracks` and TooMuchError.
    """
    every = stored.tag_names()
    wanted = None if tags is None else set(tags)
    names = every if wanted is None else {number: name for number, name in every.items() if name in wanted}
    if not names:
        return EMPTY
    level = _level(len(names), to_ns - from_ns)
    found = _summaries(stored, None if tags is None else sorted(names), len(names), level, from_ns, to_ns)
    summaries = in_order(np.concatenate([np.empty(0, SUMMARY), *found]))
    allowed = min(max_points, max(2, MAX_POINTS // len(names)))
    points = thinned(points_of(summaries), allowed)
    return Overview(names, summary_per_tag(summaries), points)


def _level(tags: int, span_ns: int) -> int:
    """Return the finest level that is read in a short time; -1 for single poses."""
    if tags * span_ns <= MAX_POSES * 1_000_000_000:
        return -1
    return FINE if tags * span_ns <= MAX_FINE * LENGTHS_NS[FINE] else COARSE


def _summaries(
    stored: StoredTracks, tags: Sequence[int] | None, count: int, level: int, from_ns: int, to_ns: int
) -> Iterator[Array]:
    """Yield SUMMARY arrays of disjoint stretches that cover the time: of each pose at level -1, else longer ones."""
    for piece in Cover(stored, "summaries", count).pieces(level, from_ns, to_ns):
        if isinstance(piece, Window):
            for poses in stored.summaries_of_poses(piece.from_ns, piece.to_ns, tags):
                yield poses if level < FINE else summary_per_tag(in_order(poses))
        else:
            yield summaries_in([blob for (blob,) in piece], tags)
