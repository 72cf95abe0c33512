"""How long the measurements of a row wait for IMU samples that arrive in batches, as phones post them.

A batch needs the wait from its oldest sample to the newest sample that its row had before. The row's measurements wait
as long as the second longest of these in the last 30 to 60 s of samples, because one late batch is no habit. A row
whose IMU samples come sooner than REORDER_WINDOW never waits longer than that.
"""

from typing import Any, Final, TypeAlias

import numpy as np

from dropanchor_service.estimation.fleet.compiled import njit

REORDER_WINDOW: Final = 250_000_000  # ns in which late samples are put in order
MARGIN: Final = 150_000_000  # ns, for batches that come later than those before
FORGET: Final = 30_000_000_000  # ns of samples, after which a wait that no batch needs ends, or twice that
MAX_DELAY: Final = 1_000_000_000  # ns behind at which the last part of a batch may end: a later end is a slow clock
MAX_LAG_S: Final = 3.5  # s that a range waits for the IMU samples of its time, at most

BATCHING: Final = np.dtype(
    [
        ("oldest", np.int64),  # ns, first sample of a batch of which parts are still missing; 0: none
        ("heard", np.int64),  # ns, newest sample of the row when the last batch came
        ("since", np.int64),  # ns, time of the sample since which the next two count; 0: no batch needed a wait
        ("longest", np.int64),  # ns, the longest wait that a batch needed
        ("needed", np.int64),  # ns, the second longest
        ("before", np.int64),  # ns, the second longest of the time before
        ("lag", np.int64),  # ns by which measurements wait longer than REORDER_WINDOW
    ]
)
Batching: TypeAlias = Any  # a record of BATCHING


@njit(nogil=True)
def learn_lag(b: Batching, before: int, oldest: int, newest: int, limit: int) -> None:
    """Learn from a batch of IMU samples, from `oldest` to `newest`, ns, of a row whose newest sample was of `before`.

    A batch may come in parts. limit: of the lag, ns: a longer one is of no use, some samples would still be too late.
    """
    b.oldest = oldest if b.oldest == 0 else b.oldest
    if before - newest > MAX_DELAY:
        return
    wait, b.oldest = before - b.oldest, 0
    if wait <= REORDER_WINDOW and b.since == 0:
        return
    is_rest = before - b.heard < REORDER_WINDOW
    b.heard = b.heard if is_rest else before
    if b.since > 0 and before - b.since > FORGET:
        b.before = b.needed if before - b.since <= 2 * FORGET else 0
        b.longest = b.needed = 0
        b.since = before if b.before > 0 else 0
    if wait > REORDER_WINDOW and not is_rest and _lag_of(wait) <= limit:
        b.since = before if b.since == 0 else b.since
        if wait > b.longest:
            b.needed, b.longest = b.longest, wait
        elif wait > b.needed:
            b.needed = wait
    b.lag = _lag_of(max(b.needed, b.before))


@njit(nogil=True)
def _lag_of(wait: int) -> int:
    return wait + MARGIN - REORDER_WINDOW if wait > REORDER_WINDOW else 0
