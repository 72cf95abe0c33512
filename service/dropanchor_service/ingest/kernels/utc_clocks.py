"""Judge the clock of a publisher that should be UTC by one number: the least of arrival minus time, over a while.

That difference is a delay, which is never negative, minus the error of the clock. So, for a clock that is off:

- **ahead**: a time in the future shows it at once, because no delay makes a difference negative.
- **behind**: the difference is large and stays the same. In a backlog the times run faster than the arrivals, so the
  difference shrinks, and a single live message ends it. It takes two periods without one to call a lag an offset.
- **right**: all else. Lateness of a few seconds is that of a network.

A publisher that was live a moment ago and whose times go back has set its clock, or it sends a backlog. Until its times
advance like the arrivals, and no live message comes between them, they are a backlog.

Only what arrives now is evidence: a message from a cache has the arrival that it would have had live.
"""

from typing import Any, Final

import numpy as np
from numba import njit

from dropanchor_service.ingest.kernels.sequences import NONE_NS, PER_TAG

NEVER_SET_NS: Final = 1_577_836_800_000_000_000  # 2020: an earlier UTC comes from a clock that was never set
NEAR_NS: Final = 2_000_000_000  # by which clocks that are right may differ
RIGHT_NS: Final = 1_000_000_000  # a clock that was off and comes this near to ours is right again
LATE_NS: Final = 10_000_000_000  # no network delays every message by more for two periods
LIVE_NS: Final = 2_000_000_000  # a message that waited for longer is no evidence
PERIOD_NS: Final = 8_000_000_000
STEADY_NS: Final = 250_000_000  # by which the least differences of two periods may differ; of a slower backlog, too
SET_NS: Final = 500_000_000  # for which times that went back must advance like the arrivals
SET_DOUBTED_NS: Final = 10_000_000_000  # the same for a publisher that sends backlog and live messages by turns
DOUBTED_NS: Final = 60_000_000_000  # for which such a publisher is remembered

WATCH: Final = np.dtype(
    [
        ("begun_ns", "i8"),  # arrival that began the present period; 0: none yet
        ("least_ns", "i8"),  # least difference in it, and in the one before; NONE_NS: not known
        ("previous_ns", "i8"),
        ("back_ns", "i8"),  # arrival since which times that went back advance like arrivals; 0: they did not go back
        ("difference_ns", "i8"),  # least of these times
        ("delay_ns", "i8"),  # least before them
        ("doubted_ns", "i8"),  # last arrival that showed that such times were those of a backlog
    ],
    align=True,
)
"""What is known of a UTC clock besides PUBLISHER. A restarted service learns it again."""


@njit(nogil=True)
def watch_lag(watch: Any, difference_ns: int, shift_ns: int, arrival_ns: int, now_ns: int) -> bool:
    """Note the difference of a message. Return whether it has been large and steady for two periods."""
    if abs(now_ns - arrival_ns) > LIVE_NS:
        return False
    if watch.begun_ns == 0 or not 0 <= arrival_ns - watch.begun_ns < 4 * PERIOD_NS:
        watch.begun_ns, watch.least_ns, watch.previous_ns = arrival_ns, difference_ns, NONE_NS
        return False
    if arrival_ns - watch.begun_ns < PERIOD_NS:
        watch.least_ns = min(watch.least_ns, difference_ns)
        return False
    least, previous = watch.least_ns, watch.previous_ns
    watch.begun_ns, watch.least_ns, watch.previous_ns = arrival_ns, difference_ns, least
    is_steady = previous != NONE_NS and abs(least - previous) <= STEADY_NS
    return bool(is_steady and min(least, previous) - shift_ns > LATE_NS)


@njit(nogil=True)
def utc_shift(publishers: Any, slot: int, watch: Any, t_ns: int, arrival_ns: int, now_ns: int, is_replay: bool) -> int:
    """Return what to add to the times of a clock that should be UTC, ns; 0 while it is right."""
    publisher = publishers[slot]
    if publisher.arrival_ns == 0:
        watch.begun_ns = watch.back_ns = watch.doubted_ns = 0
        return _first_shift(publishers, slot, arrival_ns - t_ns, t_ns)
    shift, difference = publisher.shift_ns, arrival_ns - t_ns
    if shift != 0 and abs(difference) <= RIGHT_NS:
        watch.back_ns = 0
        return 0
    passed_ns = max(arrival_ns - publisher.arrival_ns, 0)
    due_ns = min(publisher.newest_ns + shift + passed_ns, arrival_ns)
    if t_ns + shift > max(now_ns, arrival_ns) + NEAR_NS:
        # What looked like a steady lag was a backlog, unless the time itself is in the future.
        return 0 if shift > 0 and difference >= -NEAR_NS else int(due_ns - t_ns)
    goes_back = t_ns < publisher.newest_ns - NEAR_NS
    if goes_back and (is_replay or t_ns < NEVER_SET_NS):
        return int(due_ns - t_ns)
    if watch.back_ns == 0 and not goes_back:
        return int(shift)
    return _shift_back(publisher, watch, difference, arrival_ns, abs(now_ns - arrival_ns) <= LIVE_NS)


@njit(nogil=True)
def _first_shift(publishers: Any, slot: int, difference_ns: int, t_ns: int) -> int:
    """Return the shift of a new publisher: that of another one of its tag whose clock is off by the same."""
    for other in range(slot - slot % PER_TAG, slot - slot % PER_TAG + PER_TAG):
        shift = publishers[other].shift_ns
        if other != slot and shift != 0 and abs(difference_ns - shift) <= NEAR_NS < abs(difference_ns):
            return int(shift)
    return int(difference_ns) if t_ns < NEVER_SET_NS or difference_ns < -NEAR_NS else 0


@njit(nogil=True)
def _shift_back(publisher: Any, watch: Any, difference_ns: int, arrival_ns: int, is_live: bool) -> int:
    """Return the shift of a publisher whose times went back: another one once its clock was set for certain."""
    shift = publisher.shift_ns
    if watch.back_ns == 0:
        least = min(watch.least_ns, watch.previous_ns) if watch.begun_ns != 0 else NONE_NS
        watch.delay_ns = min(least, publisher.arrival_ns - publisher.newest_ns) - shift
        watch.back_ns, watch.difference_ns = arrival_ns, difference_ns
        watch.doubted_ns = watch.doubted_ns if is_live else arrival_ns
        return int(shift)
    if difference_ns - shift <= watch.delay_ns + NEAR_NS:
        watch.back_ns, watch.doubted_ns = 0, arrival_ns
        return int(shift)
    if not is_live or abs(difference_ns - watch.difference_ns) > STEADY_NS:
        watch.back_ns, watch.difference_ns, watch.doubted_ns = arrival_ns, difference_ns, arrival_ns
        return int(shift)
    watch.difference_ns = min(watch.difference_ns, difference_ns)
    if arrival_ns - watch.back_ns < (SET_DOUBTED_NS if sends_backlogs(watch, arrival_ns) else SET_NS):
        return int(shift)
    watch.back_ns = 0
    return int(watch.difference_ns - max(watch.delay_ns, 0))


@njit(nogil=True)
def sends_backlogs(watch: Any, arrival_ns: int) -> bool:
    """Return whether times of this publisher that went back were those of a backlog a short time ago."""
    return bool(watch.doubted_ns != 0 and arrival_ns - watch.doubted_ns < DOUBTED_NS)
