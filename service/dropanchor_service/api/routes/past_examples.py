"""Examples of requests and answers about the past."""

from typing import Any

_T_NS = 1_800_000_000_000_000_000


def _track(x: float) -> dict[str, Any]:
    return {
        "t_ns": [_T_NS],
        "x": [x],
        "y": [-3.4],
        "heading_rad": [0.7],
        "speed_mps": [1.1],
        "sigma_pos_m": [0.2],
        "state": ["tracking"],
    }


WHAT_IF: dict[str, Any] = {
    "from_ns": _T_NS - 60_000_000_000,
    "to_ns": _T_NS,
    "settings": {"mount_angle_rad": 1.5707963},
}
WHAT_IF_ANSWER: dict[str, Any] = {
    "run_from_ns": _T_NS - 130_000_000_000,
    "began_at_pose": True,
    "as_was": _track(12.1),
    "what_if": _track(15.6),
    "apart_m": 3.5,
}
