"""The latest pose of every tag, its hypotheses, its short history and its innovations.

One thread writes and any thread reads. Arrays have one row per tag.
"""

from collections.abc import Callable
from threading import Lock

import numpy as np

from dropanchor_service.estimation.columns import HYPOTHESIS, INNOVATION, POSE, Array, State, StateReason
from dropanchor_service.store.pose_history import PoseHistory
from dropanchor_service.store.records import copied, enlarged, put, take
from dropanchor_service.store.rings import RowRings, rank_in_row

MAX_HYPOTHESES = 8  # per tag
MAX_INNOVATIONS = 300  # per tag: half a minute at ten ranges a second
MAX_INNOVATION_BYTES = 64 * 2**20  # for all tags together


class LatestPoses:
    """Gives readers copies, made under a lock, so that no reader sees a half-written pose."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._poses = np.zeros(0, POSE)
        self._changed = np.zeros(0, np.int64)
        self._hypotheses = np.zeros((0, MAX_HYPOTHESES), HYPOTHESIS)
        self._hypothesis_counts = np.zeros(0, np.int64)
        self._history = PoseHistory()
        self._innovations = RowRings(INNOVATION, MAX_INNOVATIONS, MAX_INNOVATION_BYTES, wide=("measured",))
        self._version = 0
        self.on_change: list[Callable[[], None]] = []  # called after every change, on the thread that makes it

    @property
    def version(self) -> int:
        """A number that grows with every write."""
        return self._version

    def _tell(self) -> None:
        for told in self.on_change:
            told()

    def write(self, poses: Array, hypotheses: Array, innovations: Array | None = None) -> None:
        """Store the last pose of each row, its hypotheses, and the innovations that led to it.

        poses: POSE, in order of time per row. hypotheses: HYPOTHESIS. innovations: INNOVATION.
        """
        if len(poses) == 0:
            return
        with self._lock:
            self._grow(max(int(poses["row"].max()), int(hypotheses["row"].max(initial=-1))) + 1)
            self._version += 1
            put(self._poses, poses["row"], poses)  # with repeated rows the last pose wins
            self._changed[poses["row"]] = self._version
            self._hypothesis_counts[poses["row"]] = 0
            self._hypothesis_counts[hypotheses["row"]] = 0
            self._put_hypotheses(hypotheses)
            self._history.write(poses)
            if innovations is not None:
                self._innovations.write(innovations)
        self._tell()

    def move_future(self, now_ns: int, by_ns: int) -> None:
        """Move the poses that lie in the future, because the clock that told them was moved."""
        with self._lock:
            future = self._poses["t_ns"] > now_ns
            self._poses["t_ns"][future] += by_ns
            self._version += 1
            self._changed[future & (self._changed > 0)] = self._version
        self._tell()

    def forget(self, row: int) -> None:
        """Remove the pose of a row until the next one is written."""
        with self._lock:
            if row < len(self._changed):
                self._changed[row] = 0
                self._hypothesis_counts[row] = 0
        self._tell()

    def state(self) -> dict[str, Array]:
        """Return copies of the latest poses and their hypotheses, for a checkpoint."""
        with self._lock:
            hypotheses = take(self._hypotheses, np.arange(MAX_HYPOTHESES) < self._hypothesis_counts[:, None])
            return {"poses": take(self._poses, self._changed > 0), "hypotheses": hypotheses}

    def restore(self, state: dict[str, Array]) -> None:
        """Load what `state` returned. No tag is tracking yet: its ranges are missing since then."""
        poses = state["poses"]
        tracking = poses["state"] == State.TRACKING
        poses["state"][tracking], poses["reason"][tracking] = State.COASTING, StateReason.RANGES_MISSING
        self.write(poses, state["hypotheses"])

    def row(self, row: int) -> Array | None:
        """Return the POSE (0-d) of one row, or None before its first pose."""
        with self._lock:
            known = row < len(self._changed) and self._changed[row] > 0
            return copied(self._poses[row : row + 1])[0] if known else None

    def of(self, rows: Array) -> Array:
        """Return the POSE of these rows, in this order, without rows that have no pose."""
        with self._lock:
            known = rows[rows < len(self._changed)]
            return take(self._poses, known[self._changed[known] > 0])

    def since(self, version: int = 0) -> tuple[int, Array]:
        """Return the current version, and the POSE of every row that changed after `version`."""
        with self._lock:
            return self._version, take(self._poses, self._changed > version)

    def hypotheses(self, row: int) -> Array:
        """Return the HYPOTHESIS records of the row's latest pose; none when it is not ambiguous."""
        with self._lock:
            known = row < len(self._hypothesis_counts)
            return self._hypotheses[row, : self._hypothesis_counts[row]].copy() if known else np.empty(0, HYPOTHESIS)

    def hypotheses_of(self, rows: Array) -> tuple[Array, Array]:
        """Return the HYPOTHESIS records of these rows, row after row, and how many each row has."""
        with self._lock:
            counts = self._hypothesis_counts[rows]
            return take(take(self._hypotheses, rows), np.arange(MAX_HYPOTHESES) < counts[:, None]), counts

    def history(self, row: int) -> Array:
        """Return the decimated POSE of the row over the last minute or less, in order of time."""
        with self._lock:
            return self._history.of(row)

    def innovations(self, row: int) -> Array:
        """Return the latest INNOVATION records of the row, the oldest first."""
        with self._lock:
            return self._innovations.of(row)

    def _put_hypotheses(self, hypotheses: Array) -> None:
        if not len(hypotheses):
            return
        rank = rank_in_row(hypotheses["row"])
        kept, rank = take(hypotheses, rank < MAX_HYPOTHESES), rank[rank < MAX_HYPOTHESES]
        put(self._hypotheses, (kept["row"], rank), kept)
        np.maximum.at(self._hypothesis_counts, kept["row"], rank + 1)

    def _grow(self, rows: int) -> None:
        if rows > len(self._poses):
            capacity = max(rows, 2 * len(self._poses))
            self._poses = enlarged(self._poses, capacity)
            self._changed = enlarged(self._changed, capacity)
            self._hypotheses = enlarged(self._hypotheses, capacity)
            self._hypothesis_counts = enlarged(self._hypothesis_counts, capacity)
