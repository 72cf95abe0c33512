"""The contract of Dropanchor: what tags send, what the service answers, and under which keys.

`keys` and `wire` need the standard library only, so that a tag can import them; the pydantic models
are loaded when they are first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dropanchor_schemas.pose import Ellipse, Hypothesis, Pose, PoseList, StateReason, TrackingState
    from dropanchor_schemas.samples import SamplesMessage, decode_json
    from dropanchor_schemas.site import Anchor, Georeference, Site, StartPose, TagSettings

_HOMES = {
    "Ellipse": "pose",
    "Hypothesis": "pose",
    "Pose": "pose",
    "PoseList": "pose",
    "StateReason": "pose",
    "TrackingState": "pose",
    "SamplesMessage": "samples",
    "decode_json": "samples",
    "Anchor": "site",
    "Georeference": "site",
    "Site": "site",
    "StartPose": "site",
    "TagSettings": "site",
}

__all__ = [
    "Anchor",
    "Ellipse",
    "Georeference",
    "Hypothesis",
    "Pose",
    "PoseList",
    "SamplesMessage",
    "Site",
    "StartPose",
    "StateReason",
    "TagSettings",
    "TrackingState",
    "decode_json",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
