"""Publishers' clocks to our UTC: those that count from a start, and those that are UTC but jump.

A clock is judged by its publisher's messages in the order of their numbers: the time of each one's newest sample
against its arrival. Delay alone is no error: a backlog of minutes comes in order, its times going on.

Estimators see the intervals of a boot clock as they are, whatever the arrivals. The mapping to UTC is corrected while
it runs, but the corrections of one boot clock of each tag, its reference, change only the times of the tag's poses.
"""

from typing import Any, Final

import numpy as np
from numba import njit

from dropanchor_service.ingest.kernels.sequences import NONE_NS, PER_TAG

EPOCH_NS: Final = 30_000_000_000
PLAY_NS: Final = 3_000_000  # smaller errors of a mapping are left alone: least delays vary by as much
COARSE_NS: Final = 20_000_000  # larger ones are corrected at the fast rate
STEP_NS: Final = 250_000_000  # larger ones are corrected at once; the estimator takes ranges that are this late
SLOW: Final = 5_000  # correct by 1/SLOW of the time that passes: 200 ppm, while crystals drift by 100 ppm at most
FAST: Final = 100
FAST_MOST_NS: Final = 1_000_000  # per message; less than from one sample to the next, so that none comes late
BACK_NS: Final = 2_000_000_000  # a clock that goes back farther was set
AHEAD_NS: Final = 10_000_000_000  # of our own UTC: nobody measures in the future
NEVER_SET_NS: Final = 1_577_836_800_000_000_000  # 2020: a UTC before is that of a clock nobody has set

TAG_TIME: Final = np.dtype(
    [
        ("reference", "i4"),  # 1 + place among the tag's publishers; 0: it has no boot clock
        ("correction_ns", "i8"),  # UTC minus the estimator's time
    ],
    align=True,
)


@njit(nogil=True)
def _since_start(publisher: Any, t_ns: int, arrival_ns: int) -> int:
    """Return UTC minus a clock that counts from some start, ns. The first message sets it; later ones correct it, as
    slowly as `_slew` allows.

    Its error is its distance from the least difference between the arrival of a message and its newest sample in the
    last 30 to 60 s, because the message with the least delay tells most.
    """
    difference = arrival_ns - t_ns
    if publisher.heard_ns == 0 or t_ns < publisher.newest_ns - BACK_NS:
        publisher.least_ns, publisher.previous_least_ns = difference, NONE_NS
        publisher.epoch_end_ns = arrival_ns + EPOCH_NS
        return difference
    has_stopped = False
    if arrival_ns >= publisher.epoch_end_ns:
        has_stopped = _has_stopped(publisher)
        publisher.previous_least_ns, publisher.least_ns = publisher.least_ns, NONE_NS
        publisher.epoch_end_ns = arrival_ns + EPOCH_NS
    publisher.least_ns = min(publisher.least_ns, difference)
    error = min(publisher.least_ns, publisher.previous_least_ns) - publisher.shift_ns
    if error < -STEP_NS or has_stopped:
        return int(publisher.shift_ns + error)
    return int(publisher.shift_ns + _slew(error, t_ns - publisher.newest_ns))


@njit(nogil=True)
def _has_stopped(publisher: Any) -> bool:
    """Return whether the clock stood still for a while, as some do while the machine sleeps. Then all messages of two
    epochs are later than before, by the same time; those of a backlog are less late in the second epoch."""
    least, previous = publisher.least_ns, publisher.previous_least_ns
    return bool(min(least, previous) - publisher.shift_ns > STEP_NS and abs(least - previous) <= STEP_NS)


@njit(nogil=True)
def _slew(error_ns: int, passed_ns: int) -> int:
    """Return by how much to correct an offset with this error when so much time has passed on the publisher's clock."""
    most = max(passed_ns, 0) // SLOW
    if abs(error_ns) > COARSE_NS:
        most = max(most, min(passed_ns // FAST, FAST_MOST_NS))
    beyond = min(max(abs(error_ns) - PLAY_NS, 0), most)
    return beyond if error_ns > 0 else -beyond


@njit(nogil=True)
def _shift(publisher: Any, t_ns: int, arrival_ns: int) -> int:
    """What makes a clock that is meant to be UTC go on without a jump; 0 as long as it is right."""
    if publisher.heard_ns == 0:
        return arrival_ns - t_ns if t_ns < NEVER_SET_NS or t_ns > arrival_ns + AHEAD_NS else 0
    shift = publisher.shift_ns
    due_ns = publisher.newest_ns + shift + max(arrival_ns - publisher.heard_ns, 0)
    if shift != 0 and abs(t_ns - due_ns) <= BACK_NS:
        return 0  # it was set right
    if t_ns < publisher.newest_ns - BACK_NS or t_ns + shift > arrival_ns + AHEAD_NS:
        return int(due_ns - t_ns)
    return int(shift)


@njit(nogil=True)
def _is_reference(time: Any, publishers: Any, slot: int, arrival_ns: int) -> bool:
    """Return whether this publisher is the tag's reference. One that has been silent for a minute is replaced."""
    first = slot - slot % PER_TAG
    if time.reference == 0 or publishers[first + time.reference - 1].heard_ns < arrival_ns - 2 * EPOCH_NS:
        time.reference = slot - first + 1
    return bool(first + time.reference - 1 == slot)


@njit(cache=True, nogil=True)
def time_offsets(
    forms: Any, slots: Any, newest: Any, arrivals: Any, chosen: Any, publishers: Any, times: Any, offsets: Any
) -> int:
    """Fill `offsets` with the estimator's time minus the publisher's clock for the messages `chosen`, in this order,
    ns. Returns how many clocks jumped.

    newest: time of each message's newest sample, ns, negative without one. slots: its publisher, -1 without one.
    times: TAG_TIME of each row.
    """
    jumps = 0
    for i in chosen:
        if slots[i] < 0 or newest[i] < 0:
            continue
        publisher, time = publishers[slots[i]], times[slots[i] // PER_TAG]
        if forms[i].boot_clock:
            utc = _since_start(publisher, newest[i], arrivals[i])
            known, change = publisher.heard_ns != 0, utc - publisher.shift_ns
            jumps += known and abs(change) > STEP_NS
            if _is_reference(time, publishers, slots[i], arrivals[i]) and known and abs(change) <= STEP_NS:
                time.correction_ns += change
        else:
            utc = _shift(publisher, newest[i], arrivals[i])
            jumps += utc != publisher.shift_ns
        offsets[i] = utc - time.correction_ns
        publisher.shift_ns, publisher.newest_ns, publisher.heard_ns = utc, newest[i], arrivals[i]
    return jumps
