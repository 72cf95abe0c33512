"""Tell poses in the site frame from poses in a frame of the tag's own. The one place that makes the state `relative`.

Engines, the store and the history keep both kinds in the same fields of POSE, and its field `frame` tells which it is.
Whatever leaves the service goes through here, so that x, y, heading and covariance have one meaning outside.
"""

from dataclasses import dataclass

import numpy as np

from dropanchor_schemas.pose import Frame as FrameName
from dropanchor_schemas.pose import TrackingState
from dropanchor_service.estimation.columns import Array, Frame, State
from dropanchor_service.store.records import copied

STATES = [*(TrackingState[state.name].value for state in State), TrackingState.RELATIVE.value]
"""The names of the states that `published_states` returns."""
FRAMES = [FrameName[frame.name].value for frame in Frame]
RELATIVE = STATES.index(TrackingState.RELATIVE)

_ONE_PLACE = (State.TRACKING, State.COASTING, State.DEGRADED)
_OF_THE_FRAME = ("x", "y", "heading", "p_mode", "sigma_pos", "cov")


@dataclass(frozen=True)
class OwnFrames:
    """Poses in frames of the tags' own. poses: POSE. is_known: whether each of them is such a pose with a place."""

    poses: Array
    is_known: Array


def published_states(states: Array, frames: Array) -> Array:
    """Return the index in STATES for each State and Frame. What is placed, but not in the site frame, is `relative`."""
    published: Array = np.where((frames == Frame.RELATIVE) & np.isin(states, _ONE_PLACE), RELATIVE, states)
    return published


def in_site_frame(poses: Array) -> Array:
    """Return these POSE as they may be published: only with numbers of the site frame, and with the states of STATES.

    Speed and yaw rate are the same in every frame.
    """
    own = poses["frame"] == Frame.RELATIVE
    if not own.any():
        return poses
    published = copied(poses)
    published["state"] = published_states(poses["state"], poses["frame"])
    for name in _OF_THE_FRAME:
        published[name][own] = np.nan
    return published


def own_frames(poses: Array) -> OwnFrames | None:
    """Return which of these POSE have a place in a frame of the tag's own, None if none has."""
    has_place = np.isfinite(poses["x"]) | (poses["state"] == State.AMBIGUOUS)
    is_known = (poses["frame"] == Frame.RELATIVE) & has_place
    return OwnFrames(poses, is_known) if is_known.any() else None
