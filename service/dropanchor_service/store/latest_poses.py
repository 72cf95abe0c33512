"""The latest pose of every tag, one array with one row per tag, and what led to it; written by one thread and read by
any."""

from threading import Lock

import numpy as np

from dropanchor_service.estimation.columns import HYPOTHESIS, INNOVATION, POSE, Array, State, StateReason
from dropanchor_service.store.pose_history import PoseHistory
from dropanchor_service.store.records import copied, enlarged, put, take
from dropanchor_service.store.rings import RowRings, rank_in_row

MODES = 8  # hypotheses that are kept of a tag
INNOVATIONS = 300  # of each tag: half a minute at ten ranges a second
MOST_BYTES = 64 * 2**20  # of all of them


class LatestPoses:
    """Readers get copies; the lock is held for a copy only, so no reader sees a half-written pose."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._poses = np.zeros(0, POSE)
        self._changed = np.zeros(0, np.int64)
        self._hypotheses = np.zeros((0, MODES), HYPOTHESIS)
        self._modes = np.zeros(0, np.int64)  # how many of them each row has
        self._history = PoseHistory()
        self._innovations = RowRings(INNOVATION, INNOVATIONS, MOST_BYTES)
        self._version = 0

    @property
    def version(self) -> int:
        """Grows with every write."""
        return self._version

    def write(self, poses: Array, hypotheses: Array, innovations: Array | None = None) -> None:
        """Take the last pose of each row in `poses` (POSE, per row in order of time), the modes behind them, and the
        innovations (INNOVATION) that led there."""
        if len(poses) == 0:
            return
        with self._lock:
            self._grow(max(int(poses["row"].max()), int(hypotheses["row"].max(initial=-1))) + 1)
            self._version += 1
            put(self._poses, poses["row"], poses)  # repeated: the newest pose of the row stays
            self._changed[poses["row"]] = self._version
            self._modes[poses["row"]] = 0
            self._modes[hypotheses["row"]] = 0
            self._keep_modes(hypotheses)
            self._history.write(poses)
            if innovations is not None:
                self._innovations.write(innovations)

    def state(self) -> dict[str, Array]:
        """Copies of the latest poses, and of the modes behind them."""
        with self._lock:
            modes = take(self._hypotheses, np.arange(MODES) < self._modes[:, None])
            return {"poses": take(self._poses, self._changed > 0), "hypotheses": modes}

    def restore(self, state: dict[str, Array]) -> None:
        """Take over what `state` gave. Nobody has heard those tags since: none of them counts as tracking."""
        poses = state["poses"]
        tracking = poses["state"] == State.TRACKING
        poses["state"][tracking], poses["reason"][tracking] = State.COASTING, StateReason.RANGES_MISSING
        self.write(poses, state["hypotheses"])

    def row(self, row: int) -> Array | None:
        """POSE (0-d) of one row, None before its first pose."""
        with self._lock:
            known = row < len(self._changed) and self._changed[row] > 0
            return copied(self._poses[row : row + 1])[0] if known else None

    def of(self, rows: Array) -> Array:
        """POSE of these rows, in this order, as far as they have one."""
        with self._lock:
            known = rows[rows < len(self._changed)]
            return take(self._poses, known[self._changed[known] > 0])

    def since(self, version: int = 0) -> tuple[int, Array]:
        """The version of this answer, and POSE of every row that changed after `version`."""
        with self._lock:
            return self._version, take(self._poses, self._changed > version)

    def hypotheses(self, row: int) -> Array:
        """HYPOTHESIS behind the latest pose of the row; empty when it is not ambiguous."""
        with self._lock:
            known = row < len(self._modes)
            return self._hypotheses[row, : self._modes[row]].copy() if known else np.empty(0, HYPOTHESIS)

    def hypotheses_of(self, rows: Array) -> tuple[Array, Array]:
        """HYPOTHESIS behind the latest poses of these rows, one row after the other, and how many each has."""
        with self._lock:
            counts = self._modes[rows]
            return take(take(self._hypotheses, rows), np.arange(MODES) < counts[:, None]), counts

    def history(self, row: int) -> Array:
        """POSE of the row over the last minute or less, thinned, in order of time."""
        with self._lock:
            return self._history.of(row)

    def innovations(self, row: int) -> Array:
        """INNOVATION of the row, oldest first."""
        with self._lock:
            return self._innovations.of(row)

    def _keep_modes(self, hypotheses: Array) -> None:
        if not len(hypotheses):
            return
        rank = rank_in_row(hypotheses["row"])
        kept, rank = take(hypotheses, rank < MODES), rank[rank < MODES]
        put(self._hypotheses, (kept["row"], rank), kept)
        np.maximum.at(self._modes, kept["row"], rank + 1)

    def _grow(self, rows: int) -> None:
        if rows > len(self._poses):
            room = max(rows, 2 * len(self._poses))
            self._poses = enlarged(self._poses, room)
            self._changed = enlarged(self._changed, room)
            self._hypotheses = enlarged(self._hypotheses, room)
            self._modes = enlarged(self._modes, room)
