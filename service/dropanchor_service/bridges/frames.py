"""Names of coordinate frames, for systems that have more frames than the site's."""

from collections.abc import Mapping
from typing import Any

from dropanchor_schemas.keys import chunk_from_id

SITE = "site"


def frame_id(pose: Mapping[str, Any]) -> str:
    """Return the frame of a pose (JSON of `Pose`): the site's, or one of the tag alone if the pose is not in it."""
    in_site = pose.get("frame") in (None, SITE)
    return SITE if in_site else f"{SITE}/{chunk_from_id(pose['tag'])}"


def tag_frame_id(tag: str) -> str:
    """Return the frame that moves with the tag."""
    return f"tag/{chunk_from_id(tag)}"


def anchor_frame_id(anchor: str) -> str:
    """Return the frame of an anchor."""
    return f"anchor/{chunk_from_id(anchor)}"
