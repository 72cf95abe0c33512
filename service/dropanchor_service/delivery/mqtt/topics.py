"""The topics of one destination of poses, and what stands in them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dropanchor_schemas.keys import chunk_from_id
from dropanchor_schemas.pose import TrackingState
from dropanchor_schemas.zones import Zone
from dropanchor_service.answers.columns import REASONS, PoseColumns
from dropanchor_service.answers.frames import STATES
from dropanchor_service.answers.times import iso_utc

TRACKING = STATES.index(TrackingState.TRACKING)


@dataclass(frozen=True)
class Topics:
    """The topics of a site. What is not allowed in one level is percent-escaped."""

    prefix: str
    site: str

    @property
    def status(self) -> str:
        return f"{self.prefix}/{chunk_from_id(self.site)}/status"

    def tag(self, tag: str) -> str:
        return f"{self.prefix}/{chunk_from_id(self.site)}/tag/{chunk_from_id(tag)}"

    def zone(self, zone: str) -> str:
        return f"{self.prefix}/{chunk_from_id(self.site)}/zone/{chunk_from_id(zone)}"


def tag_state(columns: PoseColumns, place: int, name: str, zones: Sequence[Zone]) -> dict[str, Any]:
    """Return what the topic of a tag says. Only a tag that is tracked has a position.

    place: of the tag in the columns. zones: those in which it is.
    """
    pose = columns.poses[place]
    said = {
        "tag": columns.tags[place],
        "name": name,
        "t_ns": int(pose["t_ns"]),
        "t_utc": iso_utc(int(pose["t_ns"])),
        "state": STATES[pose["state"]],
        "reason": REASONS[pose["reason"]],
        "hint": str(columns.hint_texts[columns.hint[place]]),
        "zones": [zone.id for zone in zones],
        "area": ", ".join(zone.name or zone.id for zone in zones),
    }
    return said | _position(columns, place) if pose["state"] == TRACKING else said


def _position(columns: PoseColumns, place: int) -> dict[str, float]:
    """Return the numbers that are known. Latitude, longitude and accuracy have the names that Home Assistant reads."""
    pose = columns.poses[place]
    numbers = {
        "x": round(float(pose["x"]), 3),
        "y": round(float(pose["y"]), 3),
        "z": round(float(pose["z"]), 3),
        "heading_rad": round(float(pose["heading"]), 3),
        "speed_mps": round(float(pose["speed"]), 3),
        "sigma_pos_m": round(float(pose["sigma_pos"]), 3),
    }
    if columns.lat is not None and columns.lon is not None:
        numbers["latitude"] = round(float(columns.lat[place]), 8)
        numbers["longitude"] = round(float(columns.lon[place]), 8)
        numbers["gps_accuracy"] = round(float(columns.semi_major_m[place]), 2)
    return {name: number for name, number in numbers.items() if math.isfinite(number)}


def zone_state(zone: Zone, tags: Sequence[str]) -> dict[str, Any]:
    """Return what the topic of a zone says."""
    return {"zone": zone.id, "name": zone.name or zone.id, "count": len(tags), "tags": tags}
