"""Samples of many rows to one order of row and time. Measurements wait until their row's IMU has caught up."""

from typing import Final, NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import LAG, Array, SampleBatch
from dropanchor_service.estimation.fleet.frontend.batching import MAX_LAG_S, REORDER_WINDOW
from dropanchor_service.estimation.fleet.frontend.event import EVENT, KINDS, NONE, REASONS, REJECTION, UNTOUCHED
from dropanchor_service.estimation.fleet.frontend.sorting import (
    REJECTED,
    ROW_QUEUE,
    TOUCHED,
    WAITING,
    Batch,
    order_samples,
)

NEVER: Final = np.iinfo(np.int64).min // 2
FIRST_CAPACITY: Final = 64
_REASON_OF: Final = {code: reason for reason, code in REASONS.items()}


class Due(NamedTuple):
    """Samples that can be fused now. Valid until the next batch.

    order: indices into the batch's IMU samples and, behind them, `events` (EVENT); by row, then time, then kind, then
    arrival. rejected: by reason, the row of each sample of the batch that is not usable; unused: the same by kind.
    lags: LAG of the rows of the batch.
    """

    events: Array
    order: Array
    rejected: dict[str, Array]
    unused: dict[str, Array]
    lags: Array


class SampleQueue:
    """The pending events of all rows, and how far each row has come.

    max_lag_s: how long the measurements of a row wait for its IMU at most, once it has been seen to send in batches.
    """

    def __init__(self, max_lag_s: float = MAX_LAG_S) -> None:
        self._max_lag_ns = round(max_lag_s * 1e9) - REORDER_WINDOW
        self._rows = 0
        self._queues = _make_queues(0)
        self._waiting = np.zeros(0, EVENT)
        self._batch = _make_batch(FIRST_CAPACITY)

    def reach(self, rows: int) -> None:
        """Make room for this many rows."""
        self._rows = max(self._rows, rows)
        missing = rows - len(self._queues)
        if missing > 0:
            self._queues = np.concatenate([self._queues, _make_queues(max(missing, len(self._queues)))])

    def forget(self, row: int) -> None:
        """Drop all that is known of `row`."""
        self.reach(row + 1)
        self._waiting = self._waiting[self._waiting["row"] != row]
        self._queues[row] = _make_queues(1)[0]

    def state(self) -> dict[str, Array]:
        """Return what a checkpoint needs: the pending events, and the times of the newest samples."""
        return {
            "pending": self._waiting.copy(),
            "imu": self._queues["imu"][: self._rows].copy(),
            "newest": self._queues["newest"][: self._rows].copy(),
            "batching": self._queues["batching"][: self._rows].copy(),
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Take over what `state` returned."""
        self._waiting = state["pending"].copy()
        self._rows = len(state["imu"])
        self._queues = _make_queues(self._rows)
        for name in ("imu", "newest", "batching"):
            self._queues[name] = state[name]

    def due(self, samples: SampleBatch, anchors: int) -> Due:
        """Return what can be fused now.

        Raises IndexError for a sample of a row that is not configured.
        """
        columns = (samples.imu, samples.headings, samples.ranges, samples.bearings, samples.pressures)
        count = sum(map(len, columns)) + len(self._waiting)
        if count > len(self._batch.events):
            self._batch = _make_batch(2 * count)
        queues = self._queues[: self._rows]
        ordered = order_samples(*columns, anchors, queues, self._waiting, self._max_lag_ns, self._batch)
        if ordered == NONE:
            raise IndexError("a sample belongs to a row that is not configured: call configure for it first")
        self._waiting = self._batch.waiting[: self._batch.counts[WAITING]].copy()
        rejected = self._batch.rejected[: self._batch.counts[REJECTED]]
        by_reason, by_kind = _rows_by(rejected, "reason", _REASON_OF), _rows_by(rejected, "kind", KINDS)
        return Due(self._batch.events, self._batch.order[:ordered], by_reason, by_kind, self._lags())

    def _lags(self) -> Array:
        """Return LAG of the rows of the batch."""
        rows = self._batch.touched[: self._batch.counts[TOUCHED]]
        lag_ns, lags = self._queues["batching"]["lag"][rows], np.zeros(len(rows), LAG)
        lags["row"], lags["lag_ns"] = rows, np.where(lag_ns > 0, lag_ns + REORDER_WINDOW, 0)
        return lags


def _rows_by(rejected: Array, column: str, names: dict[int, str]) -> dict[str, Array]:
    """Return the rows of REJECTION by the name that a column has a code of."""
    if not len(rejected):
        return {}
    by_name = {name: rejected["row"][rejected[column] == code] for code, name in names.items()}
    return {name: rows for name, rows in by_name.items() if len(rows)}


def _make_queues(rows: int) -> Array:
    """Return ROW_QUEUE of rows that have had no sample."""
    queues = np.zeros(rows, ROW_QUEUE)
    queues["imu"] = queues["newest"] = NEVER
    queues["first"] = UNTOUCHED
    return queues


def _make_batch(samples: int) -> Batch:
    following, order, spare, touched = np.zeros((4, samples), np.int32)
    times = np.zeros(samples, np.int64)
    events, waiting, rejected = np.zeros(samples, EVENT), np.zeros(samples, EVENT), np.zeros(samples, REJECTION)
    return Batch(events, waiting, following, times, order, spare, touched, rejected, np.zeros(4, np.int64))
