"""Answer with the tracks of many tags over a period, from the history on disk."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dropanchor_schemas.tracks import Between as BetweenName
from dropanchor_service.answers.columns import ellipse_95
from dropanchor_service.answers.frames import FRAMES, STATES, published_states
from dropanchor_service.answers.pose_fields import floor_columns, height_source_values
from dropanchor_service.estimation.columns import Array, Frame
from dropanchor_service.history.summaries import RELATIVE, Between
from dropanchor_service.history.tracks import Tracks
from dropanchor_service.store.floors import Floors

_BETWEEN = [BetweenName[between.name].value for between in Between]


def many_tracks(
    tracks: Tracks, floors: Floors, tags: Sequence[str] | None, from_ns: int, to_ns: int, max_points: int
) -> dict[str, Any]:
    """Return the `Tracks` of these tags, or of all. floors: of the site.

    Raises HistoryError and TooMuchError.
    """
    found = tracks.reader.overview(tags, from_ns, to_ns, max_points)
    columns = _columns(found.points, floors)
    begins = np.searchsorted(found.points["tag"], found.figures["tag"])
    ends = np.searchsorted(found.points["tag"], found.figures["tag"], side="right")
    each = [
        {"tag": found.names[int(figures["tag"])], **figures_of(figures)}
        | {"points": {name: column[begin:end] for name, column in columns.items()}}
        for figures, begin, end in zip(found.figures, begins.tolist(), ends.tolist(), strict=True)
    ]
    return {"from_ns": from_ns, "to_ns": to_ns, "tracks": sorted(each, key=lambda track: str(track["tag"]))}


NO_FIGURES = {"poses": 0, "tracked_s": 0.0, "distance_m": 0.0, "mean_speed_mps": None, "max_speed_mps": None}


def figures_of(summary: Array) -> dict[str, Any]:
    """Return the figures of a tag, as `TagTrack` has them. summary: one SUMMARY."""
    tracked_s, distance_m = float(summary["tracked_s"]), float(summary["distance_m"])
    return {
        "poses": int(summary["poses"]),
        "tracked_s": round(tracked_s, 3),
        "distance_m": round(distance_m, 3),
        "mean_speed_mps": round(distance_m / tracked_s, 4) if tracked_s > 0 else None,
        "max_speed_mps": round(float(summary["max_speed"]), 4),
    }


def _columns(found: Array, floors: Floors) -> dict[str, Any]:
    """Return the columns of `TrackPoints`."""
    points = found["point"]
    own = (points["state"] & RELATIVE) != 0
    frames = np.where(own, Frame.RELATIVE, Frame.SITE)
    covariances = np.empty((len(points), 2, 2))
    covariances[:, 0, 0], covariances[:, 1, 1] = points["cov_xx"], points["cov_yy"]
    covariances[:, 0, 1] = covariances[:, 1, 0] = points["cov_xy"]
    major, minor, angle = ellipse_95(covariances)
    numbers = {"x": points["x"], "y": points["y"], "heading_rad": points["heading"], "speed_mps": points["speed"]}
    heights = {"z": points["z"], "z_std_m": points["z_std"]}
    numbers |= {"sigma_pos_m": points["sigma_pos"], "semi_major_m": major, "semi_minor_m": minor, "angle_rad": angle}
    states = published_states(points["state"] & ~np.uint8(RELATIVE), frames)
    in_site = {name: np.where(own & (name != "speed_mps"), np.nan, values) for name, values in numbers.items()}
    return {
        "t_ns": np.ascontiguousarray(points["t_ns"]),
        "state": [STATES[state] for state in states.tolist()],
        "frame": [FRAMES[frame] for frame in frames.tolist()],
        "relative_pose": _relative(numbers, own & np.isfinite(points["x"])),
        **{name: np.ascontiguousarray(values, np.float32) for name, values in (in_site | heights).items()},
        "z_source": height_source_values(points),
        **floor_columns(floors, points),
        "since_previous": [_BETWEEN[between] for between in found["since_previous"].tolist()],
        "off_m": np.ascontiguousarray(found["off_m"]),
    }


def _relative(numbers: Mapping[str, Array], is_known: Array) -> list[dict[str, Any] | None]:
    """Return the `RelativePose` of each point, None where it is not known. Points have no covariance of the heading."""
    found: list[dict[str, Any] | None] = [None] * len(is_known)
    of_own = {name: np.round(values[is_known].astype(float), 4).tolist() for name, values in numbers.items()}
    for i, place in enumerate(np.flatnonzero(is_known).tolist()):
        pose = {name: values[i] for name, values in of_own.items() if name != "speed_mps"}
        ellipse = {name: pose.pop(name) for name in ("semi_major_m", "semi_minor_m", "angle_rad")}
        found[place] = pose | {"ellipse_95": ellipse if math.isfinite(ellipse["semi_major_m"]) else None} | _NOT_STORED
    return found


_NOT_STORED: dict[str, Any] = {"covariance": None, "p_mode": None, "hypotheses": []}
