"""Where tags are, as omlox locations, or why a tag has none.

omlox clients draw what they get as a dot. So a tag has a location only while its place is known in the frame of the
site: not while several places are possible, while north is unknown, or after it was lost.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from dropanchor_schemas.pose import TrackingState
from dropanchor_service.answers.answers import Answer, Answers
from dropanchor_service.api.omlox.assets import Assets
from dropanchor_service.api.omlox.ids import zone_id
from dropanchor_service.api.omlox.projection import Projection
from dropanchor_service.store.omlox_models import Properties
from dropanchor_service.store.tags import Tag

SHOWN = (TrackingState.TRACKING, TrackingState.DEGRADED, TrackingState.COASTING)
"""The states in which a tag has a location, the best one first."""

_STD_95 = 1.96
_PROPERTIES = (
    "state",
    "reason",
    "hint",
    "frame",
    "covariance",
    "ellipse_95",
    "z_std_m",
    "z_source",
    "p_mode",
    "sigma_obs_m",
    "yaw_rate_radps",
    "online",
)
_WHY = ("state", "reason", "hint", "frame")


class Places:
    """Reads the latest poses."""

    def __init__(self, answers: Answers, assets: Assets) -> None:
        self._answers = answers
        self._assets = assets

    def of_tags(self, tags: Sequence[Tag], projection: Projection) -> list[Answer]:
        """Return the `Location` of each of these tags that has one."""
        return self.of_poses(self._answers.rows(tags), projection)

    def of_poses(self, poses: Any, projection: Projection) -> list[Answer]:
        """Return the `Location` of each of these POSE rows, which are the latest, that has one."""
        now_ns = self._answers.now_ns()
        return self._locations(self._answers.poses_of(poses, now_ns), projection, now_ns)

    def states(self, tags: Sequence[Tag]) -> list[Properties]:
        """Return the state of each of these tags, which says why it may have no location."""
        poses = self._answers.poses_of(self._answers.rows(tags), self._answers.now_ns())
        known = {pose["tag"]: {name: pose[name] for name in _WHY} for pose in poses}
        return [{"tag": tag.name, "online": tag.online, **(known.get(tag.name) or self._before(tag))} for tag in tags]

    def _before(self, tag: Tag) -> Properties:
        """Return the state of a tag that has no pose yet."""
        state = TrackingState.INITIALISING.value
        return {"state": state, "reason": None, "hint": self._answers.hint_of(tag), "frame": None}

    def _locations(self, poses: Iterable[Answer], projection: Projection, now_ns: int) -> list[Answer]:
        shown = [pose for pose in poses if _is_placed(pose)]
        if not shown:
            return []
        site = self._answers.site.site
        rotation = 0.0 if site.georeference is None else site.georeference.rotation_rad
        sources = {anchor.id: str(zone_id(site.id, anchor.id)) for anchor in site.anchors}
        otherwise = next(iter(sources.values()), None)
        sent = iso_ms(now_ns)
        return [
            {
                "position": {"type": "Point", "coordinates": coordinates},
                **projection.elevation(coordinates),
                "source": sources.get(pose["anchor"], otherwise) or pose["tag"],
                "provider_type": "uwb",
                "provider_id": pose["tag"],
                "trackables": [str(self._assets.id_of(pose["tag"]))],
                "timestamp_generated": iso_ms(pose["t_ns"]),
                "timestamp_sent": sent,
                "crs": projection.crs,
                **_measured(pose, rotation),
                "properties": {name: pose[name] for name in _PROPERTIES},
            }
            for pose, coordinates in zip(shown, projection.places(shown), strict=True)
        ]


def best_of(locations: Iterable[Answer]) -> Answer | None:
    """Return the location that is known best, None if there is none."""
    return min(locations, key=_rank, default=None)


def iso_ms(t_ns: int) -> str:
    """Return a time, UTC in ns, as ISO 8601 to the millisecond."""
    return f"{np.datetime64(t_ns // 1_000_000, 'ms')}Z"


def _rank(location: Answer) -> tuple[int, float]:
    return SHOWN.index(location["properties"]["state"]), location.get("accuracy", math.inf)


def _is_placed(pose: Answer) -> bool:
    return pose["state"] in SHOWN and math.isfinite(pose["x"]) and math.isfinite(pose["y"])


def _measured(pose: Answer, rotation_rad: float) -> Answer:
    """Return the fields that a pose may lack. rotation_rad: of the x axis of the site, counter-clockwise from east."""
    ellipse, heading, speed, covariance = (
        pose[name] for name in ("ellipse_95", "heading_rad", "speed_mps", "covariance")
    )
    values: Answer = {"true_heading": -1.0}
    if ellipse is not None:
        values["accuracy"] = round(ellipse["semi_major_m"], 3)
    if math.isfinite(heading):
        values["true_heading"] = round((90.0 - math.degrees(heading + rotation_rad)) % 360.0, 2)
        if covariance is not None and covariance[2][2] >= 0.0:
            values["heading_accuracy"] = round(min(math.degrees(_STD_95 * math.sqrt(covariance[2][2])), 180.0), 2)
    if math.isfinite(speed):
        values["speed"] = round(speed, 3)
    return values
