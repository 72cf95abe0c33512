"""The recent poses of each tag, decimated, in bounded memory."""

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array
from dropanchor_service.store.decimation import FirstOfSlot
from dropanchor_service.store.rings import RowRings

SPACING_NS = 250_000_000
MAX_POSES = 256  # per tag: one minute
MAX_BYTES = 128 * 2**20  # a minute for 4,000 tags, some ten seconds for 20,000


class PoseHistory:
    """Keeps one pose per quarter of a second. Not thread-safe: its owner locks."""

    def __init__(self) -> None:
        self._rings = RowRings(POSE, MAX_POSES, MAX_BYTES, wide=("x", "y", "z"))
        self._first_of_slot = FirstOfSlot(SPACING_NS)

    def write(self, poses: Array) -> None:
        """Add the first pose of each row and time slot. poses: POSE, not empty, in order of time per row."""
        self._rings.write(self._first_of_slot.select(poses))

    def of(self, row: int) -> Array:
        """Return the POSE of the row in strict order of time; after a clock was set back, only newer poses."""
        poses = self._rings.of(row)
        set_back = np.flatnonzero(np.diff(poses["t_ns"]) <= 0)
        return poses[set_back[-1] + 1 :] if len(set_back) else poses
