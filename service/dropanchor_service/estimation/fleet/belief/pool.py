"""One pool of hypothesis slots for all rows: a row's slots are a linked list, copied out to be worked on and back."""

from typing import Any

from dropanchor_service.estimation.fleet.belief.layout import KEEP, N
from dropanchor_service.estimation.fleet.compiled import njit


@njit(nogil=True)
def load(row: Any, pool: Any, work: Any) -> None:
    """Unpack the row's hypotheses into work, in the order they were stored."""
    slot = row.head
    for h in range(row.count):
        stored = pool[slot]
        work[h].log_weight = stored.log_weight
        work[h].kind = stored.kind
        work[h].blocked = stored.blocked
        work[h].clear[0] = stored.clear_offset
        work[h].clear[1] = stored.clear_variance
        k = 0
        for i in range(N):
            work[h].mean[i] = stored.mean[i]
            for j in range(i, N):
                work[h].cov[i, j] = work[h].cov[j, i] = stored.cov[k]
                k += 1
        slot = stored.next


@njit(nogil=True)
def store(row: Any, pool: Any, work: Any, count: int) -> None:
    """Pack work back, taking or returning slots: KEEP at most."""
    _resize(row, pool, min(count, KEEP))
    slot = row.head
    for h in range(row.count):
        stored = pool[slot]
        stored.log_weight = work[h].log_weight
        stored.kind = work[h].kind
        stored.blocked = work[h].blocked
        stored.clear_offset = work[h].clear[0]
        stored.clear_variance = work[h].clear[1]
        k = 0
        for i in range(N):
            stored.mean[i] = work[h].mean[i]
            for j in range(i, N):
                stored.cov[k] = work[h].cov[i, j]
                k += 1
        slot = stored.next


@njit(nogil=True)
def mirror(P: Any) -> None:
    """Exactly symmetric from the upper triangle: what is stored is then what was worked with, to the last bit."""
    for i in range(N):
        for j in range(i):
            P[i, j] = P[j, i]


@njit(nogil=True, cache=True)
def release(row: Any, pool: Any) -> None:
    """Give all slots of the row back."""
    _resize(row, pool, 0)


@njit(nogil=True)
def _resize(row: Any, pool: Any, count: int) -> None:
    while row.count > count:
        slot = row.head
        row.head = pool[slot].next
        pool[slot].next = pool[0].next
        pool[0].next = slot
        pool[0].free += 1
        row.count -= 1
    while row.count < count:
        slot = pool[0].next
        pool[0].next = pool[slot].next
        pool[0].free -= 1
        pool[slot].next = row.head
        row.head = slot
        row.count += 1
