"""The events of each row that wait for its IMU: one linked list per row, in slots that all rows share."""

from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.batching import BATCHING
from dropanchor_service.estimation.fleet.frontend.event import Event

NONE: Final = -1
UNTOUCHED: Final = -2

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
        ("pending", np.int32),  # first and last slot of the row's pending events
        ("pending_last", np.int32),
        ("waiting", np.int32),  # number of pending events
    ]
)
RowQueue: TypeAlias = Any  # a record of ROW_QUEUE


class Pending(NamedTuple):
    """Slots of pending events, in one list per row. Slot 0 is the head of the free list; counts[0] are in use."""

    events: Array  # EVENT
    following: Array
    counts: Array


@njit(nogil=True)
def free_slot(pending: Pending, slot: int) -> None:
    pending.following[slot] = pending.following[0]
    pending.following[0] = slot
    pending.counts[0] -= 1


@njit(nogil=True)
def append_slot(queue: RowQueue, pending: Pending, slot: int) -> None:
    if queue.pending == NONE:
        queue.pending = slot
    else:
        pending.following[queue.pending_last] = slot
    queue.pending_last = slot
    pending.following[slot] = NONE


@njit(cache=True, nogil=True)
def append_pending(queue: RowQueue, pending: Pending, event: Event) -> None:
    """Append the event to its row's pending ones. There must be a free slot."""
    slot = pending.following[0]
    pending.following[0] = pending.following[slot]
    pending.counts[0] += 1
    pending.events[slot] = event
    queue.waiting += 1
    append_slot(queue, pending, slot)


@njit(cache=True, nogil=True)
def drop_pending(queue: RowQueue, pending: Pending) -> None:
    """Drop all pending events of a row."""
    while queue.pending != NONE:
        slot = queue.pending
        queue.pending = pending.following[slot]
        free_slot(pending, slot)
