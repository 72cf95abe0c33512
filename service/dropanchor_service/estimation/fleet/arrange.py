"""One compiled pass that puts a batch's samples, and those that have waited, in order of row and time.

Every row that a batch touches gets a list of its samples; what is due of it is merged in order of time. A sample is an
index: inertial ones, which never wait, into their own column, all others into the batch's events behind it.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from dropanchor_service.estimation.batch import Array

from .compiled import njit
from .gather import BEARING_EVENT, HEADING_EVENT, IMU_EVENT, RANGE_EVENT

HOLD: Final = 250_000_000  # ns: the window in which late samples are put in order
TOLERANCE: Final = 40_000_000  # ns that the IMU may lag behind a measurement
SILENT: Final = 1_000_000_000  # ns without an IMU sample: nobody waits for it any more

NONE: Final = -1
UNTOUCHED: Final = -2

CLOCK: Final = np.dtype(
    [
        ("imu", np.int64),  # ns, newest inertial sample of the row
        ("newest", np.int64),  # ns, newest sample of the row
        ("imu_next", np.int64),  # with those of the batch under way
        ("newest_next", np.int64),
        ("first", np.int32),  # of the row's samples in the batch; UNTOUCHED: it has none
        ("last", np.int32),
        ("waiting", np.int32),  # first and last slot of what waits
        ("waiting_last", np.int32),
    ]
)

EVENTS, TOUCHED, ANCHOR_UNKNOWN, NOT_FINITE, LATE = range(5)  # indices of the counts of a batch
REASONS: Final = {"anchor_unknown": ANCHOR_UNKNOWN, "not_finite": NOT_FINITE, "late": LATE}


class Batch(NamedTuple):
    """Buffers of one pass, as long as it has samples and samples that wait."""

    events: Array  # EVENT
    following: Array  # the next sample of the same row
    order: Array  # the result: indices into the inertial samples and, behind them, the events
    spare: Array
    touched: Array  # rows
    counts: Array


class Held(NamedTuple):
    """Slots of samples that wait, in lists; slot 0 heads the free ones. counts[0] are in use."""

    events: Array  # EVENT
    following: Array
    counts: Array


@njit(cache=True, nogil=True)
def arrange(
    imu: Any, headings: Any, ranges: Any, bearings: Any, anchors: int, clocks: Any, held: Held, batch: Batch
) -> int:
    """Fill batch.order and return how many are due; NONE, and nothing done, where a sample's row has no clock."""
    rows = len(clocks)
    if not (_within(imu, rows) and _within(headings, rows) and _within(ranges, rows) and _within(bearings, rows)):
        return NONE
    batch.counts[:] = 0
    for k in range(len(imu)):
        _take_imu(imu, k, clocks, batch)
    for k in range(len(headings)):
        sample = headings[k]
        _take_scalar(imu, sample, sample.heading, HEADING_EVENT, NONE, clocks, batch)
    for k in range(len(ranges)):
        sample = ranges[k]
        if _anchor_known(sample.anchor, anchors, batch):
            _take_scalar(imu, sample, sample.range, RANGE_EVENT, sample.anchor, clocks, batch)
    for k in range(len(bearings)):
        sample = bearings[k]
        if _anchor_known(sample.anchor, anchors, batch):
            value = sample.bearing if sample.std > 0.0 else np.nan
            _take_scalar(imu, sample, value, BEARING_EVENT, sample.anchor, clocks, batch)
    due = 0
    for k in range(batch.counts[TOUCHED]):
        due = _choose(imu, clocks[batch.touched[k]], held, batch, due)
    return due


@njit(nogil=True)
def _within(column: Any, rows: int) -> bool:
    within = True
    for k in range(len(column)):
        within = within and 0 <= column[k].row < rows
    return within


@njit(nogil=True)
def _anchor_known(anchor: int, anchors: int, batch: Batch) -> bool:
    known = 0 <= anchor < anchors
    if not known:
        batch.counts[ANCHOR_UNKNOWN] += 1
    return known


@njit(nogil=True)
def _take_imu(imu: Any, index: int, clocks: Any, batch: Batch) -> None:
    sample = imu[index]
    if not math.isfinite(sample.gyro[0] + sample.gyro[1] + sample.gyro[2]):
        batch.counts[NOT_FINITE] += 1
        return
    clock = clocks[sample.row]
    _touch(clock, sample.row, batch)
    if sample.t_ns < clock.imu:  # of the batches before
        batch.counts[LATE] += 1
        return
    clock.imu_next = max(clock.imu_next, sample.t_ns)
    _enter(clock, sample.t_ns, index, batch)


@njit(nogil=True)
def _take_scalar(imu: Any, sample: Any, value: float, kind: int, anchor: int, clocks: Any, batch: Batch) -> None:
    if not math.isfinite(value):
        batch.counts[NOT_FINITE] += 1
        return
    clock = clocks[sample.row]
    _touch(clock, sample.row, batch)
    if sample.t_ns < clock.newest - HOLD:
        batch.counts[LATE] += 1
        return
    index = batch.counts[EVENTS]
    batch.counts[EVENTS] += 1
    event = batch.events[index]
    event.row, event.t_ns, event.kind, event.anchor = sample.row, sample.t_ns, kind, anchor
    event.value, event.std = value, sample.std
    _enter(clock, sample.t_ns, len(imu) + index, batch)


@njit(nogil=True)
def _touch(clock: Any, row: int, batch: Batch) -> None:
    """The batch has something of this row."""
    if clock.first == UNTOUCHED:
        clock.first = clock.last = NONE
        clock.imu_next, clock.newest_next = clock.imu, clock.newest
        batch.touched[batch.counts[TOUCHED]] = row
        batch.counts[TOUCHED] += 1


@njit(nogil=True)
def _enter(clock: Any, t_ns: int, index: int, batch: Batch) -> None:
    """A sample at the end of the row's list."""
    clock.newest_next = max(clock.newest_next, t_ns)
    batch.following[index] = NONE
    if clock.last == NONE:
        clock.first = index
    else:
        batch.following[clock.last] = index
    clock.last = index


@njit(nogil=True)
def _is_due(clock: Any, event: Any) -> bool:
    if clock.imu >= event.t_ns - TOLERANCE:
        return True
    return bool(clock.newest - event.t_ns >= HOLD or clock.newest - clock.imu > SILENT)


@njit(nogil=True)
def _choose(imu: Any, clock: Any, held: Held, batch: Batch, start: int) -> int:
    """The row's due events to batch.order from `start` on, in order; the others wait. Returns the end."""
    clock.imu, clock.newest = clock.imu_next, clock.newest_next
    fresh, slot = clock.first, clock.waiting
    clock.first, clock.waiting = UNTOUCHED, NONE
    end = start
    while slot != NONE:
        following = held.following[slot]
        if _is_due(clock, held.events[slot]):
            index = batch.counts[EVENTS]
            batch.counts[EVENTS] += 1
            batch.events[index] = held.events[slot]
            batch.order[end] = len(imu) + index
            end += 1
            _free(held, slot)
        else:
            _append(clock, held, slot)
        slot = following
    while fresh != NONE:
        if fresh < len(imu) or _is_due(clock, batch.events[fresh - len(imu)]):
            batch.order[end] = fresh
            end += 1
        else:
            hold(clock, held, batch.events[fresh - len(imu)])
        fresh = batch.following[fresh]
    _sort(imu, batch, start, end)
    return end


@njit(nogil=True)
def _free(held: Held, slot: int) -> None:
    held.following[slot] = held.following[0]
    held.following[0] = slot
    held.counts[0] -= 1


@njit(nogil=True)
def _append(clock: Any, held: Held, slot: int) -> None:
    if clock.waiting == NONE:
        clock.waiting = slot
    else:
        held.following[clock.waiting_last] = slot
    clock.waiting_last = slot
    held.following[slot] = NONE


@njit(cache=True, nogil=True)
def hold(clock: Any, held: Held, event: Any) -> None:
    """Let the event wait, behind those of its row that wait already. There must be a free slot."""
    slot = held.following[0]
    held.following[0] = held.following[slot]
    held.counts[0] += 1
    held.events[slot] = event
    _append(clock, held, slot)


@njit(cache=True, nogil=True)
def drop_held(clock: Any, held: Held) -> None:
    """Forget what waits of a row."""
    while clock.waiting != NONE:
        slot = clock.waiting
        clock.waiting = held.following[slot]
        _free(held, slot)


@njit(nogil=True)
def _time_of(imu: Any, batch: Batch, index: int) -> int:
    return int(imu[index].t_ns if index < len(imu) else batch.events[index - len(imu)].t_ns)


@njit(nogil=True)
def _kind_of(imu: Any, batch: Batch, index: int) -> int:
    return IMU_EVENT if index < len(imu) else int(batch.events[index - len(imu)].kind)


@njit(nogil=True)
def _after(imu: Any, batch: Batch, a: int, b: int) -> bool:
    """Sample a is later than sample b, or at the same time and of a later kind."""
    first, second = _time_of(imu, batch, a), _time_of(imu, batch, b)
    return first > second or (first == second and _kind_of(imu, batch, a) > _kind_of(imu, batch, b))


@njit(nogil=True)
def _sort(imu: Any, batch: Batch, start: int, end: int) -> None:
    """Stable, from the bottom up; two neighbouring runs that are in order are only looked at."""
    order = batch.order
    width = 1
    while width < end - start:
        for low in range(start, end - width, 2 * width):
            middle = low + width
            if _after(imu, batch, order[middle - 1], order[middle]):
                _merge(imu, batch, low, middle, min(middle + width, end))
        width *= 2


@njit(nogil=True)
def _merge(imu: Any, batch: Batch, low: int, middle: int, high: int) -> None:
    order, spare = batch.order, batch.spare
    for k in range(low, middle):
        spare[k] = order[k]
    left, right, k = low, middle, low
    while left < middle:
        if right < high and _after(imu, batch, spare[left], order[right]):
            order[k] = order[right]
            right += 1
        else:
            order[k] = spare[left]
            left += 1
        k += 1
