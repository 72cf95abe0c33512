"""The pose of a row that made the engine fail."""

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array, State, StateReason


def lost_pose(row: int, t_ns: int) -> Array:
    """Return POSE (1) of a row whose estimate is lost."""
    pose = np.zeros(1, POSE)
    for name in POSE.names or ():
        if pose[name].dtype.kind == "f":
            pose[name] = np.nan
    pose["row"], pose["t_ns"], pose["anchor"] = row, t_ns, -1
    pose["state"], pose["reason"] = State.LOST, StateReason.FAULT
    return pose
