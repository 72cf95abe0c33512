"""One pool of hypothesis slots for all rows.

The slots of a row are a linked list. `load` unpacks them into the workspace and `store` packs them back. Each lane has
a list of free slots of its own, so that several threads can work on different rows of one pool.
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


def make_pool(capacity: int, lanes: int = 1) -> Pool:
    """Return `capacity` slots. Slot k is the head of the free list of lane k, and holds no hypothesis."""
    pool = np.zeros(capacity, POOL_SLOT)
    _deal(pool, lanes, lanes)
    return pool


def _deal(pool: Pool, first: int, lanes: int) -> None:
    """Deal the slots from `first` on out to the free lists."""
    ends = first + (len(pool) - first) * np.arange(1, lanes + 1) // lanes
    pool["next"][first:] = np.arange(first + 1, len(pool) + 1)
    for lane, end in enumerate(ends.tolist()):
        pool["next"][lane], pool["free"][lane] = (first, end - first) if end > first else (-1, 0)
        pool["next"][end - 1 if end > first else lane] = -1
        first = end


def fitted(pool: Pool, rows: Rows, slots: int, lanes: int = 1) -> Pool:
    """Return the pool, or one of a better size with the same hypotheses: with `slots` free ones in each lane, or more.

    rows: all that have hypotheses.
    """
    free = pool["free"][:lanes]
    total = int(free.sum())
    enough = int(free.min()) >= slots and total <= 2 * slots * lanes + len(pool) - lanes - total
    return pool if enough else packed(pool, rows, slots, lanes)


def of_lanes(pool: Pool, rows: Rows, lanes: int) -> Pool:
    """Return a pool from a checkpoint, or one with the same hypotheses if it was one of another number of lanes."""
    slots = lanes + int(rows["count"].sum()) + int(pool["free"][:lanes].sum())
    return pool if slots == len(pool) else packed(pool, rows, MAX_HYPOTHESES, lanes)


def packed(pool: Pool, rows: Rows, slots: int, lanes: int = 1) -> Pool:
    """Return another pool with the same hypotheses: those of each row one behind the other, which is fast to read."""
    at = slots_of(rows, pool)
    used = len(at)
    moved = np.zeros(lanes + used + slots * lanes + used // 4, POOL_SLOT)
    raw = np.dtype((np.void, POOL_SLOT.itemsize))  # NumPy copies records field by field
    moved.view(raw)[lanes : lanes + used] = pool.view(raw)[at]
    moved["next"][lanes : lanes + used] = np.arange(lanes + 1, lanes + used + 1)
    _deal(moved, lanes + used, lanes)
    ends = np.cumsum(rows["count"])
    filled = rows["count"] > 0
    moved["next"][ends[filled] + lanes - 1] = -1
    rows["first_slot"][filled] = (ends - rows["count"] + lanes)[filled]
    return moved


def slots_of(rows: Rows, pool: Pool) -> npt.NDArray[np.int64]:
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
def store(row: Row, pool: Pool, work: Hypotheses, count: int, lane: int) -> None:
    """Pack up to MAX_HYPOTHESES of `work` into the row's slots. Take or return slots of the lane as needed."""
    _resize(row, pool, min(count, MAX_HYPOTHESES), lane)
    slot = row.first_slot
    for h in range(row.count):
        stored = pool[slot]
        stored.log_weight = work[h].log_weight
        stored.heading_class = work[h].heading_class
        stored.nlos = work[h].nlos
        stored.reverse = work[h].reverse
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
def release(row: Row, pool: Pool, lane: int) -> None:
    """Return all slots of the row to the lane."""
    _resize(row, pool, 0, lane)


@njit(nogil=True)
def _resize(row: Row, pool: Pool, count: int, lane: int) -> None:
    while row.count > count:
        slot = row.first_slot
        row.first_slot = pool[slot].next
        pool[slot].next = pool[lane].next
        pool[lane].next = slot
        pool[lane].free += 1
        row.count -= 1
    while row.count < count:
        slot = pool[lane].next
        pool[lane].next = pool[slot].next
        pool[lane].free -= 1
        pool[slot].next = row.first_slot
        row.first_slot = slot
        row.count += 1
