"""Names of coordinate frames, as in recordings."""

from collections.abc import Mapping
from typing import Any

SITE = "site"


def in_its_frame(pose: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a pose (JSON of `Pose`) with the numbers of its `frame_id`: of a relative one, those of its own frame."""
    return {**pose, **(pose.get("relative_pose") or {})}


def frame_id(pose: Mapping[str, Any]) -> str:
    """Return the frame of a pose (JSON of `Pose`): the site's, or one of the tag alone if the pose is relative."""
    return SITE if pose["frame"] == "site" else f"{SITE}/{pose['tag']}"


def tag_frame_id(tag: str) -> str:
    """Return the frame that moves with the tag."""
    return f"tag/{tag}"


def anchor_frame_id(anchor: str) -> str:
    """Return the frame of an anchor."""
    return f"anchor/{anchor}"
