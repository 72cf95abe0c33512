"""One compiled pass that puts a batch's samples, and those that waited, in order of row and time.

Every row that a batch touches gets a list of its samples, and what is due of it is sorted by time. A sample is an
index: below the number of IMU samples it points into their column, above it into the batch's events. IMU samples never
wait. Loops get arrays rather than tuples of arrays, because compiled code counts a reference, atomically, whenever it
takes an array out of a tuple.
"""

import math
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.batching import BATCHING, REORDER_WINDOW, learn_lag
from dropanchor_service.estimation.fleet.frontend.event import (
    ANCHOR_UNKNOWN,
    BEARING_EVENT,
    HEADING_EVENT,
    IMU_EVENT,
    LATE,
    NONE,
    NOT_FINITE,
    PRESSURE_EVENT,
    RANGE_EVENT,
    UNTOUCHED,
    Event,
)

TOLERANCE: Final = 40_000_000  # ns by which the IMU may lag behind a measurement
IMU_TIMEOUT: Final = 1_000_000_000  # ns without an IMU sample after which no measurement waits for one
MAX_WAITING: Final = 1024  # events of a row: more than 3.5 s of four anchors at 50 Hz

EVENTS, TOUCHED, REJECTED, WAITING = range(4)  # indices of the counts of a batch


ROW_QUEUE: Final = np.dtype(
    [
        ("imu", np.int64),  # ns, newest IMU sample of the row
        ("newest", np.int64),  # ns, newest sample of the row
        ("imu_next", np.int64),  # the same two with the samples of the present batch
        ("newest_next", np.int64),
        ("imu_oldest", np.int64),  # ns, first IMU sample of the present batch
        ("batching", BATCHING),
        ("first", np.int32),  # index of the row's first sample in the batch; UNTOUCHED: it has none
        ("last", np.int32),
        ("waiting", np.int32),  # number of its events that wait for its IMU
    ]
)
RowQueue: TypeAlias = Any  # a record of ROW_QUEUE


class Batch(NamedTuple):
    """Buffers of one pass, with room for all samples and all events that waited."""

    events: Array  # EVENT
    waiting: Array  # EVENT, those that go on waiting
    following: Array  # index of the next sample of the same row
    times: Array  # ns, of the samples
    order: Array  # the result: indices of samples
    spare: Array
    touched: Array  # rows
    rejected: Array  # REJECTION
    counts: Array


@njit(cache=True, nogil=True)
def order_samples(
    imu: Array,
    headings: Array,
    ranges: Array,
    bearings: Array,
    pressures: Array,
    anchors: int,
    queues: Array,
    waiting: Array,
    max_lag: int,
    batch: Batch,
) -> int:
    """Fill batch.order and return how many samples are due.

    waiting: EVENT that earlier batches brought. max_lag: ns by which a row's measurements wait longer than
    REORDER_WINDOW, at most. Return NONE, with nothing changed, where a sample belongs to a row that is not configured.
    """
    rows = len(queues)
    measured = _within(headings, rows) and _within(ranges, rows) and _within(bearings, rows)
    if not (_within(imu, rows) and measured and _within(pressures, rows)):
        return NONE
    batch.counts[:] = 0
    _add_waiting(len(imu), waiting, queues, batch)
    _add_imu(imu, queues, batch.following, batch.times, batch.touched, batch)
    for k in range(len(headings)):
        sample = headings[k]
        _add_event(len(imu), sample, sample.heading, HEADING_EVENT, NONE, sample.std, queues, batch)
    for k in range(len(ranges)):
        sample = ranges[k]
        if _anchor_known(sample, anchors, RANGE_EVENT, batch):
            _add_event(len(imu), sample, sample.range, RANGE_EVENT, sample.anchor, sample.std, queues, batch)
    for k in range(len(bearings)):
        sample = bearings[k]
        if _anchor_known(sample, anchors, BEARING_EVENT, batch):
            value = sample.bearing if sample.std > 0.0 else math.nan
            _add_event(len(imu), sample, value, BEARING_EVENT, sample.anchor, sample.std, queues, batch)
    for k in range(len(pressures)):
        sample = pressures[k]
        value = sample.pressure if sample.pressure > 0.0 else math.nan
        _add_event(len(imu), sample, value, PRESSURE_EVENT, NONE, sample.temperature, queues, batch)
    due = 0
    for k in range(batch.counts[TOUCHED]):
        start, queue = due, queues[batch.touched[k]]
        if queue.imu_next > queue.imu:
            learn_lag(queue.batching, queue.newest, queue.imu_oldest, queue.imu_next, max_lag)
        queue.imu, queue.newest = queue.imu_next, queue.newest_next
        due = _release(len(imu), len(waiting), queue, batch, start)
        _sort(batch, len(imu), start, due)
    return due


@njit(nogil=True)
def _within(column: Array, rows: int) -> bool:
    within = True
    for k in range(len(column)):
        within = within and 0 <= column[k].row < rows
    return within


@njit(nogil=True)
def _anchor_known(sample: Any, anchors: int, kind: int, batch: Batch) -> bool:
    known = bool(0 <= sample.anchor < anchors)
    if not known:
        _reject(sample.row, ANCHOR_UNKNOWN, kind, batch)
    return known


@njit(nogil=True)
def _reject(row: int, reason: int, kind: int, batch: Batch) -> None:
    rejection = batch.rejected[batch.counts[REJECTED]]
    rejection.row, rejection.reason, rejection.kind = row, reason, kind
    batch.counts[REJECTED] += 1


@njit(nogil=True)
def _add_waiting(imu_count: int, waiting: Array, queues: Array, batch: Batch) -> None:
    """Begin the lists of rows with what waited."""
    for k in range(len(waiting)):
        event = waiting[k]
        queue = queues[event.row]
        _open_list(queue, event.row, batch.touched, batch.counts)
        batch.events[k] = event
        queue.waiting += 1
        _append_sample(queue, event.t_ns, imu_count + k, batch.following, batch.times)
    batch.counts[EVENTS] = len(waiting)


@njit(nogil=True)
def _add_imu(imu: Array, queues: Array, following: Array, times: Array, touched: Array, batch: Batch) -> None:
    """Append every usable IMU sample to its row's list. One from before an earlier batch's is late."""
    counts = batch.counts
    for index in range(len(imu)):
        sample = imu[index]
        if not math.isfinite(sample.gyro[0] + sample.gyro[1] + sample.gyro[2]):
            _reject(sample.row, NOT_FINITE, IMU_EVENT, batch)
            continue
        queue, t_ns = queues[sample.row], sample.t_ns
        _open_list(queue, sample.row, touched, counts)
        if t_ns < queue.imu:
            _reject(sample.row, LATE, IMU_EVENT, batch)
            continue
        if queue.imu_next == queue.imu:
            queue.imu_oldest = t_ns
        queue.imu_next = max(queue.imu_next, t_ns)
        _append_sample(queue, t_ns, index, following, times)


@njit(nogil=True)
def _add_event(
    imu_count: int, sample: Any, value: float, kind: int, anchor: int, std: float, queues: Array, batch: Batch
) -> None:
    """Append a measurement to its row's list, unless it is not finite or too late."""
    counts = batch.counts
    if not math.isfinite(value):
        _reject(sample.row, NOT_FINITE, kind, batch)
        return
    queue = queues[sample.row]
    _open_list(queue, sample.row, batch.touched, counts)
    if sample.t_ns < max(queue.imu, queue.newest - queue.batching.lag) - REORDER_WINDOW:
        _reject(sample.row, LATE, kind, batch)
        return
    index = counts[EVENTS]
    counts[EVENTS] += 1
    event = batch.events[index]
    event.row, event.t_ns, event.kind, event.anchor = sample.row, sample.t_ns, kind, anchor
    event.value, event.std = value, std
    _append_sample(queue, sample.t_ns, imu_count + index, batch.following, batch.times)


@njit(nogil=True)
def _open_list(queue: RowQueue, row: int, touched: Array, counts: Array) -> None:
    """Note that the batch has samples of this row."""
    if queue.first == UNTOUCHED:
        queue.first = queue.last = NONE
        queue.waiting = 0
        queue.imu_next, queue.newest_next = queue.imu, queue.newest
        touched[counts[TOUCHED]] = row
        counts[TOUCHED] += 1


@njit(nogil=True)
def _append_sample(queue: RowQueue, t_ns: int, index: int, following: Array, times: Array) -> None:
    queue.newest_next = max(queue.newest_next, t_ns)
    times[index] = t_ns
    following[index] = NONE
    if queue.last == NONE:
        queue.first = index
    else:
        following[queue.last] = index
    queue.last = index


@njit(nogil=True)
def _is_due(queue: RowQueue, event: Event) -> bool:
    """Return whether an event need not wait: the row's IMU has caught up, or the wait has been long enough."""
    if queue.imu >= event.t_ns - TOLERANCE or queue.waiting >= MAX_WAITING:
        return True
    reached = queue.newest - queue.batching.lag
    return bool(reached - event.t_ns >= REORDER_WINDOW or reached - queue.imu > IMU_TIMEOUT)


@njit(nogil=True)
def _release(imu_count: int, waited: int, queue: RowQueue, batch: Batch, start: int) -> int:
    """Append the row's samples that are due to batch.order, from `start` on. The others wait. Return the end.

    waited: how many of the events, the first ones, have waited before.
    """
    index, end = queue.first, start
    queue.first = UNTOUCHED
    events, following, order = batch.events, batch.following, batch.order
    while index != NONE:
        has_waited = imu_count <= index < imu_count + waited
        if index < imu_count or _is_due(queue, events[index - imu_count]):
            order[end] = index
            end += 1
            queue.waiting -= has_waited
        else:
            batch.waiting[batch.counts[WAITING]] = events[index - imu_count]
            batch.counts[WAITING] += 1
            queue.waiting += not has_waited
        index = following[index]
    return end


@njit(nogil=True)
def _after(a: int, b: int, times: Array, imu_count: int, events: Array) -> bool:
    """Return whether sample a is later than sample b, or at the same time and of a later kind."""
    if times[a] != times[b] or a < imu_count:
        return bool(times[a] > times[b])
    return b < imu_count or bool(events[a - imu_count].kind > events[b - imu_count].kind)


@njit(nogil=True)
def _sort(batch: Batch, imu_count: int, start: int, end: int) -> None:
    """Sort batch.order[start:end] by time: a stable bottom-up merge sort that skips runs already in order."""
    order, times, events = batch.order, batch.times, batch.events
    width = 1
    while width < end - start:
        for low in range(start, end - width, 2 * width):
            middle = low + width
            if _after(order[middle - 1], order[middle], times, imu_count, events):
                _merge(batch, imu_count, low, middle, min(middle + width, end))
        width *= 2


@njit(nogil=True)
def _merge(batch: Batch, imu_count: int, low: int, middle: int, high: int) -> None:
    order, spare, times, events = batch.order, batch.spare, batch.times, batch.events
    for k in range(low, middle):
        spare[k] = order[k]
    left, right, k = low, middle, low
    while left < middle:
        if right < high and _after(spare[left], order[right], times, imu_count, events):
            order[k] = order[right]
            right += 1
        else:
            order[k] = spare[left]
            left += 1
        k += 1
