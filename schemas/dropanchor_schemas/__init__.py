"""The contract of Dropanchor: what tags send, what the service answers, and under which keys.

`keys` and `wire` need only the standard library, so a tag can import them. The pydantic models are imported on
first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dropanchor_schemas.pose import Ellipse, Hypothesis, Pose, PoseList, StateReason, TrackingState
    from dropanchor_schemas.samples import SamplesMessage, decode_json
    from dropanchor_schemas.site import Anchor, Georeference, Site, StartPose, TagSettings

_MODULES = {
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
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
