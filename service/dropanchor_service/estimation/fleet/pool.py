"""One pool of hypothesis slots for all rows: a row's slots are a linked list, copied out to be worked on and back."""

from typing import Any

from numba import njit

from .layout import KEEP, N, Work


@njit(nogil=True)
def load(row: Any, pool: Any, work: Work) -> None:
    """Unpack the row's hypotheses into work, in the order they were stored."""
    slot = row.head
    for h in range(row.count):
        stored = pool[slot]
        work.log_weight[h] = stored.log_weight
        work.kind[h] = stored.kind
        work.blocked[h] = stored.blocked
        work.clear[h, 0] = stored.clear_offset
        work.clear[h, 1] = stored.clear_variance
        k = 0
        for i in range(N):
            work.mean[h, i] = stored.mean[i]
            for j in range(i, N):
                work.cov[h, i, j] = work.cov[h, j, i] = stored.cov[k]
                k += 1
        slot = stored.next


@njit(nogil=True)
def store(row: Any, pool: Any, work: Work, count: int) -> bool:
    """Pack work back, taking or returning slots; False when the pool ran dry and hypotheses were dropped."""
    count = min(count, KEEP)
    fits = _resize(row, pool, count)
    slot = row.head
    for h in range(row.count):
        stored = pool[slot]
        stored.log_weight = work.log_weight[h]
        stored.kind = work.kind[h]
        stored.blocked = work.blocked[h]
        stored.clear_offset = work.clear[h, 0]
        stored.clear_variance = work.clear[h, 1]
        k = 0
        for i in range(N):
            stored.mean[i] = work.mean[h, i]
            for j in range(i, N):
                stored.cov[k] = work.cov[h, i, j]
                k += 1
        slot = stored.next
    return fits


@njit(nogil=True)
def mirror(P: Any) -> None:
    """Exactly symmetric from the upper triangle: what is stored is then what was worked with, to the last bit."""
    for i in range(N):
        for j in range(i):
            P[i, j] = P[j, i]


@njit(nogil=True)
def release(row: Any, pool: Any) -> None:
    """Give all slots of the row back."""
    _resize(row, pool, 0)


@njit(nogil=True)
def _resize(row: Any, pool: Any, count: int) -> bool:
    while row.count > count:
        slot = row.head
        row.head = pool[slot].next
        pool[slot].next = pool[0].next
        pool[0].next = slot
        row.count -= 1
    while row.count < count:
        slot = pool[0].next
        if slot < 0:
            return False
        pool[0].next = pool[slot].next
        pool[slot].next = row.head
        row.head = slot
        row.count += 1
    return True
