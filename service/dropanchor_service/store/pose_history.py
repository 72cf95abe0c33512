"""What each tag's poses were a little while ago, thinned, in bounded memory."""

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array
from dropanchor_service.store.rings import RowRings
from dropanchor_service.store.thinning import SlotFirsts

SPACING_NS = 250_000_000
DEPTH = 256  # poses: a minute of them
MOST_BYTES = 128 * 2**20  # a minute for 2,500 tags, a few seconds for 20,000


class PoseHistory:
    """Not locked: its owner is."""

    def __init__(self) -> None:
        self._rings = RowRings(POSE, DEPTH, MOST_BYTES)
        self._firsts = SlotFirsts(SPACING_NS)

    def write(self, poses: Array) -> None:
        """poses: POSE, not empty, per row in order of time; the first of each row and slot is kept."""
        self._rings.write(self._firsts.of(poses))

    def of(self, row: int) -> Array:
        """POSE, strictly in order of time: where a clock was set back, only what came after."""
        poses = self._rings.of(row)
        set_back = np.flatnonzero(np.diff(poses["t_ns"]) <= 0)
        return poses[set_back[-1] + 1 :] if len(set_back) else poses
