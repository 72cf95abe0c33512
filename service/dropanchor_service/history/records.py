"""A stored pose as bytes, and back."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array, Frame
from dropanchor_service.history.summaries import RELATIVE

SLOT_NS = 10_000_000_000

# The content of a row beside its key, 75 bytes. At 3 km float32 is exact to 0.2 mm.
RECORD = np.dtype(
    [
        *(("state", "u1"), ("reason", "u1"), ("anchor", "<i4")),  # state: bit 7 is the frame; anchor: its id, -1: none
        *((name, "<f4") for name in ("range", "x", "y", "heading", "speed", "yaw_rate")),
        ("cov", "<f4", 6),  # xx, xy, xh, yy, yh, hh
        *((name, "<f4") for name in ("p_mode", "sigma_pos", "sigma_obs", "z", "z_std")),
        ("z_source", "u1"),
    ]
)
NO_HEIGHT = np.array([math.nan, math.nan], "<f4").tobytes() + bytes(1)
"""The last fields of a RECORD that was written before heights were stored."""

ESTIMATED = {
    "x": "x",
    "y": "y",
    "z": "z",
    "z_std_m": "z_std",
    "heading_rad": "heading",
    "speed_mps": "speed",
    "yaw_rate_radps": "yaw_rate",
    "p_mode": "p_mode",
    "sigma_pos_m": "sigma_pos",
    "sigma_obs_m": "sigma_obs",
    "range_m": "range",
}
"""Numbers of an estimate, and the fields of POSE that hold them."""
_SAME_IN_POSE = ("state", "reason", "z_source", *ESTIMATED.values())
_UPPER_TRIANGLE = np.triu_indices(3)


@dataclass(frozen=True)
class StoredPoses:
    """Poses from the file. poses: POSE with rows and anchor indices of -1; anchors: the anchor id of each pose.

    epochs: of the process that wrote each pose, 0 without a cluster.
    """

    poses: Array
    anchors: list[str | None]
    epochs: Array

    def first(self, count: int) -> "StoredPoses":
        return StoredPoses(self.poses[:count], self.anchors[:count], self.epochs[:count])


NO_POSES = StoredPoses(np.empty(0, POSE), [], np.empty(0, np.int64))


def records_of(poses: Array, anchors: Array) -> list[bytes]:
    """Return the RECORD of each POSE as bytes."""
    records = np.zeros(len(poses), RECORD)
    for name in _SAME_IN_POSE:
        records[name] = poses[name]
    records["anchor"] = anchors
    records["state"] |= np.where(poses["frame"] == Frame.RELATIVE, RELATIVE, 0).astype(np.uint8)
    records["cov"] = poses["cov"][:, *_UPPER_TRIANGLE]
    packed, size = records.tobytes(), RECORD.itemsize
    return [packed[start : start + size] for start in range(0, len(packed), size)]


def stored_poses(rows: Sequence[tuple[int, bytes]], anchor_names: Mapping[int, str]) -> StoredPoses:
    """Return the poses of these rows: time, and RECORD as bytes, which may end before its height."""
    blobs = [(blob + NO_HEIGHT)[: RECORD.itemsize] for _, blob in rows]
    records = np.frombuffer(b"".join(blobs), RECORD)
    poses = np.zeros(len(rows), POSE)
    poses["row"], poses["anchor"] = -1, -1
    poses["t_ns"] = [t_ns for t_ns, _ in rows]
    for name in _SAME_IN_POSE:
        poses[name] = records[name]
    poses["frame"] = np.where(records["state"] & RELATIVE, Frame.RELATIVE, Frame.SITE)
    poses["state"] &= ~np.uint8(RELATIVE)
    poses["cov"][:, *_UPPER_TRIANGLE] = records["cov"]
    poses["cov"][:, *_UPPER_TRIANGLE[::-1]] = records["cov"]
    anchors = [anchor_names.get(anchor_id) for anchor_id in records["anchor"].tolist()]
    return StoredPoses(poses, anchors, np.zeros(len(poses), np.int64))  # no cluster writes files
