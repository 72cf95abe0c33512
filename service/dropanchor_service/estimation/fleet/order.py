"""Samples of all kinds into one order of row and time; measurements wait until their row's IMU has caught up."""

from collections import Counter
from typing import Any, Final

import numpy as np

from dropanchor_service.estimation.batch import Array, SampleBatch

from .gather import BEARING_EVENT, EVENT, HEADING_EVENT, IMU_EVENT, RANGE_EVENT

HOLD: Final = 250_000_000  # ns: the window in which late samples are put in order
TOLERANCE: Final = 40_000_000  # ns that the IMU may lag behind a measurement
SILENT: Final = 1_000_000_000  # ns without an IMU sample: nobody waits for it any more
NEVER: Final = np.iinfo(np.int64).min // 2


class Order:
    """What is waiting, and how far each row has come."""

    def __init__(self) -> None:
        self._waiting = np.zeros(0, EVENT)
        self._imu = np.zeros(0, np.int64)  # ns, newest inertial sample of each row
        self._newest = np.zeros(0, np.int64)  # ns, newest sample of each row

    def forget(self, row: int) -> None:
        """Start `row` afresh."""
        self._reach(row + 1)
        self._imu[row] = self._newest[row] = NEVER
        self._waiting = self._waiting[self._waiting["row"] != row]

    def state(self) -> dict[str, Array]:
        return {"waiting": self._waiting.copy(), "imu": self._imu.copy(), "newest": self._newest.copy()}

    def restore(self, state: dict[str, Array]) -> None:
        self._waiting, self._imu, self._newest = state["waiting"], state["imu"], state["newest"]

    def due(self, samples: SampleBatch, anchors: int, rejected: Counter[str]) -> Array:
        """EVENT by row, then time, then kind, then arrival; counts what is not usable in `rejected`."""
        fresh = _usable(_events(samples), anchors, rejected)
        if len(fresh):
            self._reach(int(fresh["row"].max()) + 1)
        fresh = self._in_time(fresh, rejected)
        inertial = fresh["kind"] == IMU_EVENT
        np.maximum.at(self._imu, fresh["row"][inertial], fresh["t_ns"][inertial])
        np.maximum.at(self._newest, fresh["row"], fresh["t_ns"])
        events = np.concatenate([self._waiting, fresh])
        ready = self._ready(events)
        self._waiting = events[~ready]
        events = events[ready]
        return np.asarray(events[np.lexsort((events["kind"], events["t_ns"], events["row"]))])

    def _ready(self, events: Array) -> Any:
        imu, newest, t = self._imu[events["row"]], self._newest[events["row"]], events["t_ns"]
        waited = newest - t >= HOLD
        silent = newest - imu > SILENT
        return (events["kind"] == IMU_EVENT) | (imu >= t - TOLERANCE) | waited | silent

    def _in_time(self, events: Array, rejected: Counter[str]) -> Array:
        """Inertial samples and headings cannot be used behind the newest one, measurements behind the window."""
        rows = events["row"]
        inertial = events["kind"] == IMU_EVENT
        late = np.where(inertial, events["t_ns"] < self._imu[rows], events["t_ns"] < self._newest[rows] - HOLD)
        if late.any():
            rejected["late"] += int(late.sum())
        return np.asarray(events[~late])

    def _reach(self, rows: int) -> None:
        missing = rows - len(self._imu)
        if missing > 0:
            never = np.full(missing, NEVER, np.int64)
            self._imu = np.concatenate([self._imu, never])
            self._newest = np.concatenate([self._newest, never])


def _events(samples: SampleBatch) -> Array:
    """All samples as EVENT, in order of arrival within their kind."""
    kinds = (
        (IMU_EVENT, samples.imu, ()),
        (HEADING_EVENT, samples.headings, ("heading", "std")),
        (RANGE_EVENT, samples.ranges, ("range", "std")),
        (BEARING_EVENT, samples.bearings, ("bearing", "std")),
    )
    parts = []
    for kind, columns, names in kinds:
        part = np.zeros(len(columns), EVENT)
        part["row"], part["t_ns"], part["kind"] = columns["row"], columns["t_ns"], kind
        for i, name in enumerate(names):
            part["value"][:, i] = columns[name]
        if kind >= RANGE_EVENT:
            part["anchor"] = columns["anchor"]
        if kind == IMU_EVENT:
            part["value"][:, 0:3], part["value"][:, 3:6] = columns["acc"], columns["gyro"]
            part["value"][:, 6:9] = columns["mag"]
        parts.append(part)
    return np.concatenate(parts)


def _usable(events: Array, anchors: int, rejected: Counter[str]) -> Array:
    """Values are screened before; this keeps the rows safe all the same."""
    measures = events["kind"] >= RANGE_EVENT
    unknown = measures & ((events["anchor"] < 0) | (events["anchor"] >= anchors))
    first = np.where(events["kind"] == IMU_EVENT, events["value"][:, 3:6].sum(axis=1), events["value"][:, 0])
    broken = ~np.isfinite(first) & ~unknown
    broken |= (events["kind"] == BEARING_EVENT) & ~(events["value"][:, 1] > 0.0) & ~unknown
    for reason, bad in (("anchor_unknown", unknown), ("not_finite", broken)):
        if bad.any():
            rejected[reason] += int(bad.sum())
    return events[~(unknown | broken)]
