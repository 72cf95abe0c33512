"""Summaries of tracks: what a stretch of time holds of each tag, so that a month can be read without its poses.

Two neighbouring stretches have the summary of the whole: their sums, and what lies between the last pose of the one
and the first pose of the other. A single pose is the summary of its instant.
"""

from collections.abc import Sequence
from enum import IntEnum

import numpy as np

from dropanchor_service.estimation.columns import Array, State
from dropanchor_service.history.shapes import by_shape, off_the_line
from dropanchor_service.store.records import put, take

GAP_NS = 10_000_000_000  # nothing is known between two poses that are further apart
MOVING_MPS = 0.1  # the noise of a tag that stands is no distance
RELATIVE = 0x80  # bit of the state that says that the pose is in a frame of the tag's own

SAME_IN_POINT = ("t_ns", "state", "x", "y", "z", "z_std", "z_source", "heading", "speed", "sigma_pos")
"""Fields that a POSE and a POINT share."""

POINT = np.dtype(
    [
        ("t_ns", "<i8"),
        ("state", "u1"),  # State, and the bit RELATIVE
        *((name, "<f4") for name in ("x", "y", "heading", "speed", "sigma_pos", "cov_xx", "cov_xy", "cov_yy")),
        *((name, "<f4") for name in ("z", "z_std")),
        ("z_source", "u1"),
    ]
)
SUMMARY = np.dtype(
    [
        ("tag", "<u4"),
        ("first", POINT),
        ("last", POINT),
        ("poses", "<u4"),
        ("between", "u1"),  # Between: the worst from the first to the last pose
        ("distance_m", "<f4"),
        ("tracked_s", "<f4"),
        ("max_speed", "<f4"),  # m/s, NaN: never tracked
    ]
)
TRACK_POINT = np.dtype([("tag", "<u4"), ("point", POINT), ("since_previous", "u1"), ("off_m", "<f4")])


class Between(IntEnum):
    """What is known of the way of a tag between two points."""

    TRACKING = 0
    DOUBTFUL = 1  # some poses were coasting or degraded
    UNKNOWN = 2  # some poses were at no place of the map, or there was no pose for `GAP_NS`


def summary_of_each(tags: Array, points: Array) -> Array:
    """Return the SUMMARY of each single pose. tags: number of the tag of each POINT."""
    summaries = np.zeros(len(points), SUMMARY)
    summaries["tag"], summaries["first"], summaries["last"], summaries["poses"] = tags, points, points, 1
    summaries["max_speed"] = np.where(_tracked(points), np.abs(points["speed"]), np.nan)
    return summaries


def summaries_in(blobs: Sequence[bytes], tags: Sequence[int] | None) -> Array:
    """Return the SUMMARY records in these blobs, only those of the tags with these numbers."""
    summaries = np.frombuffer(b"".join(blobs), SUMMARY)
    return summaries if tags is None else take(summaries, np.isin(summaries["tag"], tags))


def in_order(summaries: Array) -> Array:
    """Return the summaries ordered by tag and time."""
    return take(summaries, np.lexsort((summaries["first"]["t_ns"], summaries["tag"])))


def summary_per_tag(summaries: Array) -> Array:
    """Return one SUMMARY for each tag. summaries: those of disjoint stretches of time, in order."""
    if len(summaries) == 0:
        return summaries
    begins = _begins(summaries["tag"])
    starts, ends = np.flatnonzero(begins), np.append(np.flatnonzero(begins)[1:], len(summaries)) - 1
    between, distance, tracked = _since_previous(summaries)
    inner = np.where(begins, Between.TRACKING, between)
    whole = take(summaries, starts)
    whole["last"] = summaries["last"][ends]
    whole["poses"] = np.add.reduceat(summaries["poses"], starts)
    whole["between"] = np.maximum.reduceat(np.maximum(summaries["between"], inner), starts)
    whole["distance_m"] = np.add.reduceat(summaries["distance_m"] + distance, starts)
    whole["tracked_s"] = np.add.reduceat(summaries["tracked_s"] + tracked, starts)
    whole["max_speed"] = np.fmax.reduceat(summaries["max_speed"], starts)
    return whole


def points_of(summaries: Array) -> Array:
    """Return the TRACK_POINT at both ends of each SUMMARY, in the same order. off_m: NaN within one with more."""
    points = np.zeros((len(summaries), 2), TRACK_POINT)
    points["tag"] = summaries["tag"][:, None]
    for column, end in enumerate(("first", "last")):
        put(points["point"][:, column], slice(None), summaries[end])
    points["since_previous"][:, 0] = _since_previous(summaries)[0] if len(summaries) else Between.UNKNOWN
    points["since_previous"][:, 1] = summaries["between"]
    points["off_m"][:, 1] = np.where(summaries["poses"] > 2, np.nan, 0.0)
    several = np.column_stack([np.ones(len(summaries), bool), summaries["poses"] > 1])
    return take(points, several)


def thinned(points: Array, max_points: int) -> Array:
    """Return at most `max_points` of each tag: the first, the last, changes of state, and others.

    points: TRACK_POINT, in order. The others are even in time; where they would be further apart than `GAP_NS`, half of
    them are those that the shape of the track needs most. Changes of state beyond half of the points are left out.
    `since_previous` and `off_m` of a point always tell the worst since the previous point that is left.
    """
    if len(points) == 0:
        return points
    begins = _begins(points["tag"])
    changes = _state_changes(points, begins, (max_points - 2) // 2)
    bins = np.maximum(1, max_points - 2 - np.add.reduceat(changes, np.flatnonzero(begins), dtype=np.int64))
    fixed = changes | begins | np.append(begins[1:], True)
    first, is_long = _first_of_bin(points["point"]["t_ns"], begins, bins)
    point = points["point"]
    kept = fixed | first
    if is_long.any():
        even = fixed | _first_of_bin(point["t_ns"], begins, np.maximum(1, bins // 2))[0]
        kept = np.where(is_long, by_shape(points["tag"], point["x"], point["y"], even, max_points), kept)
    places = np.flatnonzero(kept)
    left = take(points, places)
    since = np.append(0, places[:-1] + 1)
    worst = np.maximum.reduceat(np.where(begins, 0, points["since_previous"]), since)
    left["since_previous"] = np.where(begins[places], Between.UNKNOWN, worst)
    left["off_m"] = np.maximum.reduceat(
        np.maximum(points["off_m"], off_the_line(point["x"], point["y"], places)), since
    )
    return left


def _first_of_bin(t_ns: Array, begins: Array, bins: Array) -> tuple[Array, Array]:
    """Return whether each point is the first in its bin, and whether this is longer than `GAP_NS`.

    bins: into how many the time of each tag is divided.
    """
    starts = np.flatnonzero(begins)
    ends = np.append(starts[1:], len(t_ns)) - 1
    length = -(-(t_ns[ends] - t_ns[starts] + 1) // bins)
    counts = ends - starts + 1
    number = (t_ns - np.repeat(t_ns[starts], counts)) // np.repeat(length, counts)
    first: Array = begins | np.append(True, number[1:] != number[:-1])
    return first, np.repeat(length > GAP_NS, counts)


def _state_changes(points: Array, begins: Array, limit: int) -> Array:
    """Return whether the state changes with each point. Only the first `limit` changes of a tag count."""
    state = points["point"]["state"]
    changes = ~begins & np.append(False, state[1:] != state[:-1])
    count = np.cumsum(changes)
    before_tag = np.repeat((count - changes)[begins], np.diff(np.append(np.flatnonzero(begins), len(points))))
    limited: Array = changes & (count - before_tag <= limit)
    return limited


def _since_previous(summaries: Array) -> tuple[Array, Array, Array]:
    """Return Between, distance [m] and tracked time [s] from the end of the previous SUMMARY of the tag to each."""
    end, start = summaries["last"][:-1], summaries["first"][1:]
    elapsed_ns = start["t_ns"] - end["t_ns"]
    known = ~_begins(summaries["tag"])[1:] & (elapsed_ns <= GAP_NS) & is_placed(end) & is_placed(start)
    tracked = known & _tracked(end) & _tracked(start)
    between = np.where(tracked, Between.TRACKING, np.where(known, Between.DOUBTFUL, Between.UNKNOWN))
    with np.errstate(invalid="ignore"):
        moving = ~(np.maximum(np.abs(end["speed"]), np.abs(start["speed"])) < MOVING_MPS)
        dx, dy = start["x"] - end["x"], start["y"] - end["y"]
    distance = np.where(tracked & moving, np.hypot(dx, dy), 0.0)
    elapsed_s = np.where(tracked, elapsed_ns * 1e-9, 0.0)
    return np.append(Between.UNKNOWN, between), np.append(0.0, distance), np.append(0.0, elapsed_s)


def _begins(tags: Array) -> Array:
    """Return whether each entry is the first of its tag."""
    return np.append(True, tags[1:] != tags[:-1])


def _tracked(points: Array) -> Array:
    tracked: Array = (points["state"] == State.TRACKING) & np.isfinite(points["x"])
    return tracked


def is_placed(points: Array) -> Array:
    """Return whether the position of each POINT is a place of the map."""
    placed: Array = np.isin(points["state"], _PLACED) & np.isfinite(points["x"])
    return placed


_PLACED = (State.TRACKING, State.COASTING, State.DEGRADED)  # without the bit RELATIVE
