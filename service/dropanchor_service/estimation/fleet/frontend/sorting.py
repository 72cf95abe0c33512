"""One compiled pass that puts a batch's samples, and those that have waited, in order of row and time.

Every row that a batch touches gets a list of its samples; what is due of it is merged in order of time. A sample is an
index: inertial ones, which never wait, into their own column, all others into the batch's events behind it. Loops are
handed arrays: compiled code counts a reference, atomically, whenever it takes an array out of a tuple.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.assembly import BEARING_EVENT, HEADING_EVENT, RANGE_EVENT

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
    times: Array  # ns, of the samples
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
    _take_imu(imu, clocks, batch.following, batch.times, batch.touched, batch.counts)
    for k in range(len(headings)):
        sample = headings[k]
        _take_scalar(len(imu), sample, sample.heading, HEADING_EVENT, NONE, clocks, batch)
    for k in range(len(ranges)):
        sample = ranges[k]
        if _anchor_known(sample.anchor, anchors, batch):
            _take_scalar(len(imu), sample, sample.range, RANGE_EVENT, sample.anchor, clocks, batch)
    for k in range(len(bearings)):
        sample = bearings[k]
        if _anchor_known(sample.anchor, anchors, batch):
            value = sample.bearing if sample.std > 0.0 else np.nan
            _take_scalar(len(imu), sample, value, BEARING_EVENT, sample.anchor, clocks, batch)
    due = 0
    for k in range(batch.counts[TOUCHED]):
        start, clock = due, clocks[batch.touched[k]]
        clock.imu, clock.newest = clock.imu_next, clock.newest_next
        due = _release(len(imu), clock, held, batch, start)
        due = _choose(len(imu), clock, held, batch.events, batch.following, batch.order, due)
        _sort(batch, len(imu), start, due)
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
def _take_imu(imu: Any, clocks: Any, following: Any, times: Any, touched: Any, counts: Any) -> None:
    for index in range(len(imu)):
        sample = imu[index]
        if not math.isfinite(sample.gyro[0] + sample.gyro[1] + sample.gyro[2]):
            counts[NOT_FINITE] += 1
            continue
        clock, t_ns = clocks[sample.row], sample.t_ns
        _touch(clock, sample.row, touched, counts)
        if t_ns < clock.imu:  # of the batches before
            counts[LATE] += 1
            continue
        clock.imu_next = max(clock.imu_next, t_ns)
        _enter(clock, t_ns, index, following, times)


@njit(nogil=True)
def _take_scalar(inertial: int, sample: Any, value: float, kind: int, anchor: int, clocks: Any, batch: Batch) -> None:
    counts = batch.counts
    if not math.isfinite(value):
        counts[NOT_FINITE] += 1
        return
    clock = clocks[sample.row]
    _touch(clock, sample.row, batch.touched, counts)
    if sample.t_ns < clock.newest - HOLD:
        counts[LATE] += 1
        return
    index = counts[EVENTS]
    counts[EVENTS] += 1
    event = batch.events[index]
    event.row, event.t_ns, event.kind, event.anchor = sample.row, sample.t_ns, kind, anchor
    event.value, event.std = value, sample.std
    _enter(clock, sample.t_ns, inertial + index, batch.following, batch.times)


@njit(nogil=True)
def _touch(clock: Any, row: int, touched: Any, counts: Any) -> None:
    """The batch has something of this row."""
    if clock.first == UNTOUCHED:
        clock.first = clock.last = NONE
        clock.imu_next, clock.newest_next = clock.imu, clock.newest
        touched[counts[TOUCHED]] = row
        counts[TOUCHED] += 1


@njit(nogil=True)
def _enter(clock: Any, t_ns: int, index: int, following: Any, times: Any) -> None:
    """A sample at the end of the row's list."""
    clock.newest_next = max(clock.newest_next, t_ns)
    times[index] = t_ns
    following[index] = NONE
    if clock.last == NONE:
        clock.first = index
    else:
        following[clock.last] = index
    clock.last = index


@njit(nogil=True)
def _is_due(clock: Any, event: Any) -> bool:
    if clock.imu >= event.t_ns - TOLERANCE:
        return True
    return bool(clock.newest - event.t_ns >= HOLD or clock.newest - clock.imu > SILENT)


@njit(nogil=True)
def _release(inertial: int, clock: Any, held: Held, batch: Batch, start: int) -> int:
    """What has waited and is due to batch.order from `start` on; the others go on waiting. Returns the end."""
    slot, end = clock.waiting, start
    clock.waiting = NONE
    while slot != NONE:
        following = held.following[slot]
        if _is_due(clock, held.events[slot]):
            index = batch.counts[EVENTS]
            batch.counts[EVENTS] += 1
            batch.events[index] = held.events[slot]
            batch.times[inertial + index] = held.events[slot].t_ns
            batch.order[end] = inertial + index
            end += 1
            _free(held, slot)
        else:
            _append(clock, held, slot)
        slot = following
    return end


@njit(nogil=True)
def _choose(inertial: int, clock: Any, held: Held, events: Any, following: Any, order: Any, start: int) -> int:
    """The row's fresh samples that are due to order from `start` on; the others wait. Returns the end."""
    index, end = clock.first, start
    clock.first = UNTOUCHED
    while index != NONE:
        if index < inertial or _is_due(clock, events[index - inertial]):
            order[end] = index
            end += 1
        else:
            hold(clock, held, events[index - inertial])
        index = following[index]
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
def _after(a: int, b: int, times: Any, inertial: int, events: Any) -> bool:
    """Sample a is later than sample b, or at the same time and of a later kind."""
    if times[a] != times[b] or a < inertial:
        return bool(times[a] > times[b])
    return b < inertial or bool(events[a - inertial].kind > events[b - inertial].kind)


@njit(nogil=True)
def _sort(batch: Batch, inertial: int, start: int, end: int) -> None:
    """Stable, from the bottom up; two neighbouring runs that are in order are only looked at."""
    order, times, events = batch.order, batch.times, batch.events
    width = 1
    while width < end - start:
        for low in range(start, end - width, 2 * width):
            middle = low + width
            if _after(order[middle - 1], order[middle], times, inertial, events):
                _merge(batch, inertial, low, middle, min(middle + width, end))
        width *= 2


@njit(nogil=True)
def _merge(batch: Batch, inertial: int, low: int, middle: int, high: int) -> None:
    order, spare, times, events = batch.order, batch.spare, batch.times, batch.events
    for k in range(low, middle):
        spare[k] = order[k]
    left, right, k = low, middle, low
    while left < middle:
        if right < high and _after(spare[left], order[right], times, inertial, events):
            order[k] = order[right]
            right += 1
        else:
            order[k] = spare[left]
            left += 1
        k += 1
