"""Decimate poses: keep one per time slot, and fewer of a tag that stands still."""

from array import array

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.store.records import take

_KEPT = np.dtype([("t_ns", "i8"), ("x", "f8"), ("y", "f8"), ("z", "f8"), ("state", "i2"), ("frame", "u1")])
CLIMB_M = 0.5  # of a tag that climbs; the height that a barometer shows of one that stands wanders by less


class FirstOfSlot:
    """Selects the first pose of every row and time slot. Not thread-safe: its owner locks."""

    def __init__(self, slot_ns: int) -> None:
        self._slot_ns = slot_ns
        self._slots = array("q")  # by row: slot of its newest pose

    def select(self, poses: Array) -> Array:
        """Return the first pose of each row and slot.

        poses: POSE, not empty, in order of time per row.
        """
        rows, slots = poses["row"].tolist(), (poses["t_ns"] // self._slot_ns).tolist()
        self._slots.extend([-1] * (max(rows) + 1 - len(self._slots)))
        firsts = []
        for index, (row, slot) in enumerate(zip(rows, slots, strict=True)):
            if self._slots[row] != slot:
                self._slots[row] = slot
                firsts.append(index)
        return take(poses, firsts)


class Decimation:
    """Keeps at most one pose per row and period, and drops poses that add little.

    A pose is kept when it is `distance_m` away from the last kept pose of its row, CLIMB_M higher or lower, has another
    state or frame, or comes `still_ns` after it. Not thread-safe.
    """

    def __init__(self, period_ns: int, distance_m: float = 0.0, still_ns: int = 0) -> None:
        self._first_of_slot = FirstOfSlot(period_ns)
        self._distance_m = distance_m
        self._still_ns = still_ns
        self._kept = np.zeros(0, _KEPT)

    def select(self, poses: Array) -> Array:
        """Return the poses to keep. poses: POSE, in order of time per row."""
        if len(poses) == 0:
            return poses
        firsts = self._first_of_slot.select(poses)
        if len(firsts) == 0:
            return firsts
        self._grow(int(firsts["row"].max()) + 1)
        chosen = np.zeros(len(firsts), bool)
        left = np.arange(len(firsts))
        while len(left):  # one pass takes the next pose of every row
            _, first = np.unique(firsts["row"][left], return_index=True)
            turn = left[first]
            kept = turn[~self._adds_nothing(firsts[turn])]
            chosen[kept] = True
            self._remember(firsts[kept])
            left = np.delete(left, first)
        return firsts[chosen]

    def _adds_nothing(self, poses: Array) -> Array:
        before = self._kept[poses["row"]]
        with np.errstate(invalid="ignore"):  # an unknown position is not near
            near = np.hypot(poses["x"] - before["x"], poses["y"] - before["y"]) < self._distance_m
            climbed = np.abs(poses["z"] - before["z"]) >= CLIMB_M
        both_unknown = np.isnan(poses["x"]) & np.isnan(before["x"])
        soon = np.abs(poses["t_ns"] - before["t_ns"]) < self._still_ns
        alike = (poses["state"] == before["state"]) & (poses["frame"] == before["frame"])
        same: Array = (near | both_unknown) & ~climbed & soon & alike
        return same

    def _remember(self, poses: Array) -> None:
        for name in self._kept.dtype.names or ():
            self._kept[name][poses["row"]] = poses[name]

    def _grow(self, rows: int) -> None:
        missing = rows - len(self._kept)
        if missing > 0:
            more = np.zeros(max(missing, len(self._kept)), self._kept.dtype)
            more["state"] = -1
            self._kept = np.concatenate([self._kept, more])
