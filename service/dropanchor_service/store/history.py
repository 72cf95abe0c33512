"""What each tag's poses were a little while ago, thinned, in bounded memory."""

import numpy as np

from dropanchor_service.estimation.batch import POSE, Array
from dropanchor_service.store.rings import RowRings

SPACING_NS = 250_000_000
DEPTH = 256  # poses: a minute of them
MOST_BYTES = 128 * 2**20  # a minute for 2,500 tags, a few seconds for 20,000


class PoseHistory:
    """Not locked: its owner is."""

    def __init__(self) -> None:
        self._rings = RowRings(POSE, DEPTH, MOST_BYTES)
        self._slot = np.zeros(0, np.int64)  # of the newest pose of each row, in units of SPACING_NS

    def write(self, poses: Array) -> None:
        """poses: POSE, not empty, per row in order of time; the first of each row and slot is kept."""
        missing = int(poses["row"].max()) + 1 - len(self._slot)
        if missing > 0:
            self._slot = np.concatenate([self._slot, np.full(max(missing, len(self._slot)), -1)])
        ordered = poses[np.argsort(poses["row"], kind="stable")]
        rows, slots = ordered["row"], ordered["t_ns"] // SPACING_NS
        before = np.append(-1, slots[:-1])
        begins = np.append(True, rows[1:] != rows[:-1])
        before[begins] = self._slot[rows[begins]]
        self._slot[rows] = slots
        self._rings.write(ordered[slots != before])

    def of(self, row: int) -> Array:
        """POSE, strictly in order of time: where a clock was set back, only what came after."""
        poses = self._rings.of(row)
        set_back = np.flatnonzero(np.diff(poses["t_ns"]) <= 0)
        return poses[set_back[-1] + 1 :] if len(set_back) else poses
