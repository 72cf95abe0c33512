"""Answer from the history on disk: a page of a track, or the pose at a time long ago."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from dropanchor_service.answers.columns import REASONS
from dropanchor_service.answers.frames import FRAMES, STATES, in_site_frame, own_frames
from dropanchor_service.answers.geodesy import altitude, lat_lon
from dropanchor_service.answers.pose_at_time import FAR_NS, NoPoseThenError, pose_between
from dropanchor_service.answers.pose_fields import (
    covariance_values,
    floor_columns,
    height_source_values,
    relative_values,
)
from dropanchor_service.answers.times import isos_utc
from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.records import ESTIMATED, StoredPoses
from dropanchor_service.history.tracks import Tracks
from dropanchor_service.store.site import SiteStore


@dataclass(frozen=True)
class TrackPage:
    """Poses of one tag in order of time.

    columns: those of `TrackPose`. next_ns: start of the next page, None after the last page.
    """

    columns: dict[str, list[Any]]
    next_ns: int | None

    def __len__(self) -> int:
        return len(self.columns["t_ns"])

    def rows(self) -> list[dict[str, Any]]:
        """Return a `TrackPose` for each pose."""
        names = list(self.columns)
        return [dict(zip(names, row, strict=True)) for row in zip(*self.columns.values(), strict=True)]


def track_page(tracks: Tracks, site: SiteStore, tag: str, from_ns: int, to_ns: int, limit: int) -> TrackPage:
    """Return the first `limit` poses from `from_ns` to `to_ns`, both included. Raises HistoryError."""
    found = tracks.reader.poses(tag, from_ns, to_ns, limit + 1)
    next_ns = int(found.poses["t_ns"][limit]) if len(found.poses) > limit else None
    return TrackPage(_columns(found.first(limit), site), next_ns)


def pose_in_tracks(tracks: Tracks, site: SiteStore, tag: str, memory: Array, t_ns: int) -> Array | None:
    """Return POSE (0-d) at a time, from the stored poses before and after it; None for a tag without a history.

    memory: POSE that may not have been written to disk yet. Raises NoPoseThenError.
    """
    try:
        before = tracks.reader.poses(tag, max(0, t_ns - FAR_NS), t_ns, 1, newest_first=True)
        after = tracks.reader.poses(tag, t_ns, t_ns + FAR_NS, 1)
        if len(memory) == len(before.poses) == len(after.poses) == 0 and not tracks.reader.has_tag(tag):
            return None
    except HistoryError as error:
        raise NoPoseThenError(f"the history cannot be read ({error})") from error
    earlier = [*_indexed(before, site), *memory[memory["t_ns"] <= t_ns][-1:]]
    later = [*_indexed(after, site), *memory[memory["t_ns"] >= t_ns][:1]]
    return pose_between(
        max(earlier, key=lambda pose: int(pose["t_ns"]), default=None),
        min(later, key=lambda pose: int(pose["t_ns"]), default=None),
        t_ns,
    )


def _indexed(stored: StoredPoses, site: SiteStore) -> Array:
    """Return the stored POSE with the site's index of the anchor of each, -1 for none."""
    index = {anchor.id: number for number, anchor in enumerate(site.anchors_by_index())}
    stored.poses["anchor"] = [-1 if anchor is None else index.get(anchor, -1) for anchor in stored.anchors]
    return stored.poses


def _columns(stored: StoredPoses, site: SiteStore) -> dict[str, list[Any]]:
    """Return the columns of `TrackPose`, with the digits of a float32, as it was stored."""
    poses = in_site_frame(stored.poses)
    columns: dict[str, list[Any]] = {
        "t_ns": poses["t_ns"].tolist(),
        "t_utc": isos_utc(poses["t_ns"]),
        "state": [STATES[state] for state in poses["state"].tolist()],
        "reason": [REASONS[reason] for reason in poses["reason"].tolist()],
        "frame": [FRAMES[frame] for frame in poses["frame"].tolist()],
        "relative_pose": _relative(stored.poses),
        **{name: _short(poses[field]).tolist() for name, field in ESTIMATED.items()},
        "z_source": height_source_values(poses),
        **floor_columns(site.floors, poses),
        "covariance": covariance_values(_short(poses["cov"])),
        "anchor": list(stored.anchors),
    }
    origin = site.site.georeference
    if origin is not None:
        lat, lon = lat_lon(origin, poses["x"], poses["y"])
        columns["lat"], columns["lon"] = np.round(lat, 9).tolist(), np.round(lon, 9).tolist()
        alt_m = altitude(origin, poses["z"])
        if alt_m is not None:
            columns["alt_m"] = np.round(alt_m, 3).tolist()
    return columns | {"epoch": stored.epochs.tolist()}


def _relative(poses: Array) -> list[dict[str, Any] | None]:
    """Return the `RelativePose` of each stored POSE, None where it has none."""
    own = own_frames(poses)
    if own is None:
        return [None] * len(poses)
    short = poses.copy()
    for name in ("x", "y", "heading", "p_mode", "sigma_pos", "cov"):
        short[name] = _short(poses[name])
    return relative_values(short, own.is_known)


def _short(values: Array) -> Array:
    """Round float64 values to the digits of the float32 that they were read from."""
    with np.errstate(invalid="ignore", divide="ignore"):
        digits = 7 - np.ceil(np.log10(np.abs(values)))
    scale = 10.0 ** np.where(np.isfinite(digits), digits, 0.0)
    return np.round(values * scale) / scale
