"""One pool of hypothesis slots for all rows.

The slots of a row are a linked list. `load` unpacks them into the workspace and `store` packs them back.
"""

import numpy as np
import numpy.typing as npt

from dropanchor_service.estimation.fleet.belief.layout import (
    MAX_HYPOTHESES,
    POOL_SLOT,
    Floats,
    Hypotheses,
    N,
    Pool,
    Row,
    Rows,
)
from dropanchor_service.estimation.fleet.compiled import njit


def make_pool(capacity: int) -> Pool:
    """Return `capacity` slots in one free list. Slot 0 is the head of that list and holds no hypothesis."""
    pool = np.zeros(capacity, POOL_SLOT)
    pool["next"] = np.arange(1, capacity + 1)
    pool["next"][-1] = -1
    pool["free"][0] = capacity - 1
    return pool


def fitted(pool: Pool, rows: Rows, slots: int) -> Pool:
    """Return the pool, or one of a better size with the same hypotheses: with `slots` free slots, and few more.

    rows: all that have hypotheses. In another pool those of each row lie one behind the other, which is fast to read.
    """
    free = int(pool["free"][0])
    used = len(pool) - 1 - free
    if slots <= free <= 2 * slots + used:
        return pool
    moved = make_pool(1 + used + slots + used // 4)
    at = _slots_of(rows, pool)
    raw = np.dtype((np.void, POOL_SLOT.itemsize))  # NumPy copies records field by field
    moved.view(raw)[1 : used + 1] = pool.view(raw)[at]
    moved["next"][1 : used + 1] = np.arange(2, used + 2)
    moved["next"][0], moved["free"][0] = used + 1, len(moved) - 1 - used
    ends = np.cumsum(rows["count"])
    filled = rows["count"] > 0
    moved["next"][ends[filled]] = -1
    rows["first_slot"][filled] = (ends - rows["count"] + 1)[filled]
    return moved


def _slots_of(rows: Rows, pool: Pool) -> npt.NDArray[np.int64]:
    """Return the slots of all hypotheses, row after row, in the order in which they are stored."""
    counts = rows["count"].astype(np.int64)
    slots = np.empty(counts.sum(), np.int64)
    left = np.flatnonzero(counts)
    at, first = rows["first_slot"][left], (np.cumsum(counts) - counts)
    for k in range(int(counts.max(initial=0))):
        slots[first[left] + k] = at
        more = counts[left] > k + 1
        left, at = left[more], pool["next"][at[more]]
    return slots


@njit(nogil=True)
def load(row: Row, pool: Pool, work: Hypotheses) -> None:
    """Unpack the row's hypotheses into `work`, in the order they were stored."""
    slot = row.first_slot
    for h in range(row.count):
        stored = pool[slot]
        work[h].log_weight = stored.log_weight
        work[h].heading_class = stored.heading_class
        work[h].nlos = stored.nlos
        work[h].reverse = stored.reverse
        work[h].aligned = stored.aligned
        work[h].los_bias = stored.los_bias
        work[h].los_bias_var = stored.los_bias_var
        k = 0
        for i in range(N):
            work[h].mean[i] = stored.mean[i]
            for j in range(i, N):
                work[h].cov[i, j] = work[h].cov[j, i] = stored.cov[k]
                k += 1
        slot = stored.next


@njit(nogil=True)
def store(row: Row, pool: Pool, work: Hypotheses, count: int) -> None:
    """Pack up to MAX_HYPOTHESES of `work` into the row's slots. Take or return slots as needed."""
    _resize(row, pool, min(count, MAX_HYPOTHESES))
    slot = row.first_slot
    for h in range(row.count):
        stored = pool[slot]
        stored.log_weight = work[h].log_weight
        stored.heading_class = work[h].heading_class
        stored.nlos = work[h].nlos
        stored.reverse = work[h].reverse
        stored.aligned = work[h].aligned
        stored.los_bias = work[h].los_bias
        stored.los_bias_var = work[h].los_bias_var
        k = 0
        for i in range(N):
            stored.mean[i] = work[h].mean[i]
            for j in range(i, N):
                stored.cov[k] = work[h].cov[i, j]
                k += 1
        slot = stored.next


@njit(nogil=True)
def mirror(P: Floats) -> None:
    """Copy the upper triangle of P to the lower one, so that a stored hypothesis equals the one worked on."""
    for i in range(N):
        for j in range(i):
            P[i, j] = P[j, i]


@njit(nogil=True, cache=True)
def release(row: Row, pool: Pool) -> None:
    """Return all slots of the row."""
    _resize(row, pool, 0)


@njit(nogil=True)
def _resize(row: Row, pool: Pool, count: int) -> None:
    while row.count > count:
        slot = row.first_slot
        row.first_slot = pool[slot].next
        pool[slot].next = pool[0].next
        pool[0].next = slot
        pool[0].free += 1
        row.count -= 1
    while row.count < count:
        slot = pool[0].next
        pool[0].next = pool[slot].next
        pool[0].free -= 1
        pool[slot].next = row.first_slot
        row.first_slot = slot
        row.count += 1
