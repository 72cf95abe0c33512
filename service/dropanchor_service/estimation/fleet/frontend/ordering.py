"""Samples of all kinds into one order of row and time; measurements wait until their row's IMU has caught up."""

from collections import Counter
from typing import Final, NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array, SampleBatch
from dropanchor_service.estimation.fleet.frontend.assembly import EVENT
from dropanchor_service.estimation.fleet.frontend.sorting import (
    CLOCK,
    NONE,
    REASONS,
    UNTOUCHED,
    Batch,
    Held,
    arrange,
    drop_held,
    hold,
)

NEVER: Final = np.iinfo(np.int64).min // 2


class Due(NamedTuple):
    """order: indices into the batch's inertial samples and, behind them, events (EVENT), by row, then time, then kind,
    then arrival. Valid until the next batch."""

    events: Array
    order: Array


class Order:
    """What is waiting, and how far each row has come."""

    def __init__(self) -> None:
        self._rows = 0
        self._clocks = _clocks(0)
        self._held = _held(64)
        self._batch = _batch(64)

    def reach(self, rows: int) -> None:
        """Make room for this many rows."""
        self._rows = max(self._rows, rows)
        missing = rows - len(self._clocks)
        if missing > 0:
            self._clocks = np.concatenate([self._clocks, _clocks(max(missing, len(self._clocks)))])

    def forget(self, row: int) -> None:
        """Start `row` afresh."""
        self.reach(row + 1)
        drop_held(self._clocks[row], self._held)
        self._clocks[row] = _clocks(1)[0]

    def state(self) -> dict[str, Array]:
        waiting = [self._waiting(row) for row in np.flatnonzero(self._clocks["waiting"] != NONE).tolist()]
        return {
            "waiting": np.concatenate([np.zeros(0, EVENT), *waiting]),
            "imu": self._clocks["imu"][: self._rows].copy(),
            "newest": self._clocks["newest"][: self._rows].copy(),
        }

    def restore(self, state: dict[str, Array]) -> None:
        self._held, self._batch = _held(64), _batch(64)
        self._rows = len(state["imu"])
        self._clocks = _clocks(self._rows)
        self._clocks["imu"], self._clocks["newest"] = state["imu"], state["newest"]
        self._make_room(0, len(state["waiting"]))
        for event in state["waiting"]:
            hold(self._clocks[event["row"]], self._held, event)

    def due(self, samples: SampleBatch, anchors: int, rejected: Counter[str]) -> Due:
        """What can be fused now; counts what is not usable in `rejected`."""
        columns = (samples.imu, samples.headings, samples.ranges, samples.bearings)
        count = sum(map(len, columns))
        self._make_room(count, count - len(samples.imu))
        ordered = arrange(*columns, anchors, self._clocks[: self._rows], self._held, self._batch)
        if ordered == NONE:
            raise IndexError("samples of a row that is not configured")
        for reason, index in REASONS.items():
            if self._batch.counts[index]:
                rejected[reason] += int(self._batch.counts[index])
        return Due(self._batch.events, self._batch.order[:ordered])

    def _make_room(self, samples: int, measurements: int) -> None:
        held = self._held.counts[0]
        if held + measurements >= len(self._held.events):
            self._held = _enlarged(self._held, 2 * (held + measurements))
        if samples + held > len(self._batch.events):
            self._batch = _batch(2 * (samples + held))

    def _waiting(self, row: int) -> Array:
        slots, slot = [], self._clocks[row]["waiting"]
        while slot != NONE:
            slots.append(slot)
            slot = self._held.following[slot]
        return self._held.events[slots]


def _clocks(rows: int) -> Array:
    """CLOCK of rows that have heard nothing."""
    clocks = np.zeros(rows, CLOCK)
    clocks["imu"] = clocks["newest"] = NEVER
    clocks["first"] = UNTOUCHED
    clocks["last"] = clocks["waiting"] = clocks["waiting_last"] = NONE
    return clocks


def _held(slots: int) -> Held:
    following = np.arange(1, slots + 1, dtype=np.int32)
    following[-1] = NONE
    return Held(np.zeros(slots, EVENT), following, np.zeros(1, np.int64))


def _enlarged(held: Held, slots: int) -> Held:
    """The same slots in use, and more of them free."""
    grown, have = _held(slots), len(held.events)
    grown.events[:have] = held.events
    grown.following[:have] = held.following
    tail = 0
    while grown.following[tail] != NONE:
        tail = int(grown.following[tail])
    grown.following[tail] = have
    grown.counts[:] = held.counts
    return grown


def _batch(samples: int) -> Batch:
    following, order, spare, touched = np.zeros((4, samples), np.int32)
    times = np.zeros(samples, np.int64)
    return Batch(np.zeros(samples, EVENT), following, times, order, spare, touched, np.zeros(5, np.int64))
