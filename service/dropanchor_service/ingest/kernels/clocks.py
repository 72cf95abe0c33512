"""Map publishers' clocks to our UTC: clocks that count from a start here, clocks that should be UTC in `utc_clocks.py`.

A clock is judged by its publisher's messages in the order of their numbers: the time of the newest sample of each is
compared with its arrival.

Estimators use the intervals of a clock unchanged, whatever the arrivals. The mapping of a boot clock to UTC is
corrected all the time, but for one boot clock of each tag, its reference, the corrections change only the times of the
tag's poses. So it is where we learn that a UTC clock is off, and the clock itself did not jump.
"""

from typing import Any, Final

import numpy as np
from numba import njit

from dropanchor_schemas.times import EARLIEST_UTC_NS
from dropanchor_service.ingest.kernels.sensor_clocks import compare, first_shift
from dropanchor_service.ingest.kernels.sequences import NONE_NS, PER_TAG
from dropanchor_service.ingest.kernels.utc_clocks import NEAR_NS, sends_backlogs, utc_shift, watch_lag

EPOCH_NS: Final = 30_000_000_000
DEADBAND_NS: Final = 3_000_000  # smaller errors of a mapping are not corrected: least delays vary by as much
COARSE_NS: Final = 20_000_000  # larger ones are corrected at the fast rate
STEP_NS: Final = 250_000_000  # larger ones are corrected at once; the estimator takes ranges that are this late
SLOW: Final = 5_000  # correct by 1/SLOW of the time that passes: 200 ppm, while crystals drift by 100 ppm at most
FAST: Final = 100
FAST_MAX_NS: Final = 1_000_000  # per message; less than the time between samples, so that their order stays
BACK_NS: Final = 2_000_000_000  # a boot clock that goes back farther counts from another start
DAY_NS: Final = 86_400_000_000_000

TAG_TIME: Final = np.dtype(
    [
        ("reference", "i4"),  # 1 + place among the tag's publishers; 0: it has no boot clock
        ("correction_ns", "i8"),  # UTC minus the estimator's time
    ],
    align=True,
)


@njit(nogil=True)
def _since_start(publisher: Any, t_ns: int, arrival_ns: int) -> int:
    """Return UTC minus a clock that counts from some start, ns.

    The first message sets it. Later ones correct it, as slowly as `_slew` allows. The error is the distance from the
    least difference between the arrival of a message and its newest sample in the last 30 to 60 s, because the message
    with the least delay is the most accurate.
    """
    difference = arrival_ns - t_ns
    if publisher.arrival_ns == 0 or t_ns < publisher.newest_ns - BACK_NS:
        publisher.least_ns, publisher.previous_least_ns = difference, NONE_NS
        publisher.epoch_end_ns = arrival_ns + EPOCH_NS
        return difference
    has_stopped = arrival_ns >= publisher.epoch_end_ns and _has_stopped(publisher)
    _note_difference(publisher, difference, arrival_ns)
    error = min(publisher.least_ns, publisher.previous_least_ns) - publisher.shift_ns
    if error < -STEP_NS or has_stopped:
        return int(publisher.shift_ns + error)
    return int(publisher.shift_ns + _slew(error, t_ns - publisher.newest_ns))


@njit(nogil=True)
def _note_difference(publisher: Any, difference_ns: int, arrival_ns: int) -> None:
    """Note the difference between the arrival of a message and its newest sample; only the least of an epoch stays."""
    if arrival_ns >= publisher.epoch_end_ns:
        publisher.previous_least_ns, publisher.least_ns = publisher.least_ns, NONE_NS
        publisher.epoch_end_ns = arrival_ns + EPOCH_NS
    publisher.least_ns = min(publisher.least_ns, difference_ns)


@njit(nogil=True)
def _has_stopped(publisher: Any) -> bool:
    """Return whether the clock stood still for a while, as some do while the machine sleeps.

    All messages of two epochs are then later than before, by the same time. Those of a backlog are less late in the
    second epoch.
    """
    least, previous = publisher.least_ns, publisher.previous_least_ns
    return bool(min(least, previous) - publisher.shift_ns > STEP_NS and abs(least - previous) <= STEP_NS)


@njit(nogil=True)
def _slew(error_ns: int, passed_ns: int) -> int:
    """Return the correction of an offset with this error, ns. passed_ns: time that passed on the publisher's clock."""
    limit = max(passed_ns, 0) // SLOW
    if abs(error_ns) > COARSE_NS:
        limit = max(limit, min(passed_ns // FAST, FAST_MAX_NS))
    correction = min(max(abs(error_ns) - DEADBAND_NS, 0), limit)
    return correction if error_ns > 0 else -correction


@njit(nogil=True)
def _is_reference(time: Any, publishers: Any, slot: int, arrival_ns: int) -> bool:
    """Return whether this publisher is the tag's reference. One that has been silent for a minute is replaced."""
    first = slot - slot % PER_TAG
    if time.reference == 0 or publishers[first + time.reference - 1].arrival_ns < arrival_ns - 2 * EPOCH_NS:
        time.reference = slot - first + 1
    return bool(first + time.reference - 1 == slot)


@njit(nogil=True)
def _looks_like_now(t_ns: int, arrival_ns: int) -> bool:
    """Return whether a time is that of the arrival, to the day, in s, ms or µs."""
    in_s = abs(arrival_ns // 1_000_000_000 - t_ns) <= DAY_NS // 1_000_000_000
    in_ms = abs(arrival_ns // 1_000_000 - t_ns) <= DAY_NS // 1_000_000
    return bool(in_s or in_ms or abs(arrival_ns // 1_000 - t_ns) <= DAY_NS // 1_000)


@njit(nogil=True)
def _is_no_utc(form: Any, publisher: Any, t_ns: int, arrival_ns: int) -> bool:
    """Return whether a time that should be UTC is in another unit, or counts from a start without saying so.

    A publisher that was right before has a clock that was reset, which goes on. So does a replay of an old recording.
    """
    if form.boot_clock or form.replay or t_ns >= EARLIEST_UTC_NS:
        return False
    return bool(publisher.arrival_ns == 0 or _looks_like_now(t_ns, arrival_ns))


@njit(nogil=True)
def _move(publisher: Any, newest_ns: int, boot_clock: bool, back: bool) -> None:
    """Go on with a publisher after the shift of its motion has changed, which changes the newest time of its message.

    back: the motion goes back. A boot clock that was mapped by it is mapped again.
    """
    moved_ns = newest_ns - publisher.newest_ns
    publisher.newest_ns = newest_ns
    if boot_clock:
        if back:
            publisher.shift_ns = publisher.least_ns = publisher.arrival_ns - newest_ns
            publisher.previous_least_ns, publisher.epoch_end_ns = NONE_NS, publisher.arrival_ns + EPOCH_NS
        return
    if publisher.least_ns != NONE_NS:
        publisher.least_ns -= moved_ns
    if publisher.previous_least_ns != NONE_NS:
        publisher.previous_least_ns -= moved_ns
    if abs(newest_ns - publisher.arrival_ns) <= NEAR_NS:
        publisher.shift_ns = 0  # what looked like a jump was the motion


@njit(nogil=True)
def _change_shift(publisher: Any, watch: Any, time: Any, t_ns: int, change_ns: int, newest_ns: int) -> None:
    """Note that the shift of a UTC clock changes.

    If the estimator's time goes on only that way, what changes is its UTC. Else the clock has jumped, and the shift
    removes the jump. newest_ns: of the estimator's times so far.
    """
    publisher.least_ns, publisher.epoch_end_ns = NONE_NS, 0  # differences of another clock, in effect
    watch.begun_ns = 0
    before_ns = t_ns + publisher.shift_ns - time.correction_ns
    if publisher.arrival_ns != 0 and abs(before_ns - newest_ns) < abs(before_ns + change_ns - newest_ns):
        time.correction_ns += change_ns


@njit(cache=True, nogil=True)
def time_offsets(
    forms: Any,
    slots: Any,
    newest: Any,
    counts: Any,
    arrivals: Any,
    chosen: Any,
    publishers: Any,
    times: Any,
    watches: Any,
    estimated: Any,
    now_ns: int,
    offsets: Any,
    motion: Any,
    restarts: Any,
    doubted: Any,
    doubtful: Any,
) -> int:
    """Fill `offsets` with the estimator's time minus the publisher's clock, ns. Return how many clocks jumped.

    chosen: indices of the messages, in the order of their publishers. newest: (n, 3), time of each message's newest
    motion, range and other sample, ns, negative for none. counts: (n, 3), of these samples. slots: its publisher, -1
    for none. times: TAG_TIME of each row. watches: WATCH of each publisher. estimated: newest of the estimator's times
    of each row, 0: none yet. motion: filled with what to add to the times of motion besides. restarts: set where the
    motion goes back in time, which an estimator does not see: the motion that it left out is missing. doubted: set
    where the clock of a publisher or of the host is off. doubtful: set where a clock was set, or a backlog begins.
    """
    jumps = 0
    for i in chosen:
        t_ns = max(newest[i, 0], newest[i, 1], newest[i, 2])
        if slots[i] < 0 or t_ns < 0:
            continue
        row = slots[i] // PER_TAG
        publisher, time, watch = publishers[slots[i]], times[row], watches[slots[i]]
        if _is_no_utc(forms[i], publisher, t_ns, arrivals[i]):
            continue
        publisher.kinds |= forms[i].kinds
        is_first = publisher.arrival_ns == 0
        if is_first and not forms[i].boot_clock and not forms[i].replay:
            publisher.motion_shift_ns = first_shift(newest[i], arrivals[i])
        t_ns = _newest(newest[i], publisher.motion_shift_ns)
        if forms[i].boot_clock:
            utc = _since_start(publisher, t_ns, arrivals[i])
            change = utc - publisher.shift_ns
            jumps += not is_first and abs(change) > STEP_NS
            if _is_reference(time, publishers, slots[i], arrivals[i]) and not is_first and abs(change) <= STEP_NS:
                time.correction_ns += change
        else:
            utc = utc_shift(publishers, slots[i], watch, t_ns, arrivals[i], now_ns, forms[i].replay)
            change = utc - publisher.shift_ns
            if change != 0:
                jumps += 1
                _change_shift(publisher, watch, time, t_ns, change, estimated[row])
            if not forms[i].replay:
                _note_difference(publisher, arrivals[i] - t_ns, arrivals[i])
                doubtful[i] = watch.back_ns != 0 and not sends_backlogs(watch, arrivals[i])
                doubted[i] = watch_lag(watch, arrivals[i] - t_ns, utc, arrivals[i], now_ns) or (change != 0 and utc < 0)
        offsets[i], motion[i] = utc - time.correction_ns, publisher.motion_shift_ns
        publisher.shift_ns, publisher.newest_ns, publisher.arrival_ns = utc, t_ns, arrivals[i]
        if not forms[i].replay and compare(publishers, slots[i], newest[i], counts[i], arrivals[i]):
            restarts[i] = publisher.motion_shift_ns - motion[i] < -STEP_NS
            _move(publisher, _newest(newest[i], publisher.motion_shift_ns), forms[i].boot_clock, restarts[i])
            watch.begun_ns = watch.back_ns = 0
            offsets[i], motion[i] = publisher.shift_ns - time.correction_ns, publisher.motion_shift_ns
        estimated[row] = max(estimated[row], publisher.newest_ns + offsets[i])
    return jumps


@njit(nogil=True)
def _newest(newest: Any, motion_shift_ns: int) -> int:
    """Return the time of the newest sample of a message. newest: of its motion, ranges and other samples."""
    moved_ns = newest[0] + motion_shift_ns if newest[0] >= 0 else newest[0]
    return int(max(moved_ns, newest[1], newest[2]))
