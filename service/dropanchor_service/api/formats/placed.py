"""What formats for maps share, which have no field for an uncertainty: GPX and KML."""

import math
from datetime import UTC, datetime
from typing import Any

from dropanchor_service.answers.track_pages import TrackPage

GAP_NS = 10_000_000_000  # a longer gap starts a new segment
_PLACED = ("tracking", "coasting", "degraded")


def placed(page: TrackPage) -> list[dict[str, Any]]:
    """Return the poses of a page that are known to be at one place on the Earth."""
    return [pose for pose in page.rows() if pose["state"] in _PLACED and math.isfinite(pose["lat"])]


def is_apart(pose: dict[str, Any], last_ns: int | None) -> bool:
    """Return whether a pose comes long after the one of `last_ns`."""
    return last_ns is not None and pose["t_ns"] - last_ns > GAP_NS


def utc(t_ns: int) -> str:
    seconds, rest = divmod(t_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest // 1_000_000:03d}Z"
