"""Put numbered messages into the order of their publisher: find those that are due, duplicates and pending ones.

The messages of a publisher that counts without a gap pass as they arrive (`pass_in_order`). Those behind a gap are
pending until the missing message arrives or the window is over (`release`). A gap that is larger than what a publisher
can have sent is none: the publisher counts from another number now, and nothing is missing.
"""

from typing import Any, Final

import numpy as np
from numba import njit

PER_TAG: Final = 4  # publishers of a tag whose state is kept
WINDOW: Final = 1024  # messages behind the newest in which a duplicate is recognised
_LANES: Final = WINDOW // 64
MESSAGES_PER_S: Final = 1000  # no publisher sends as many

UNUSED: Final = 0
STARTING: Final = 1  # no message has passed yet
RUNNING: Final = 2

PASS: Final = 0
PENDING: Final = 1
DUPLICATE: Final = 2
REFUSED: Final = 3  # the payload was not accepted

PUBLISHER: Final = np.dtype(
    [
        ("boot_id", "u4"),
        ("next", "u4"),  # the expected number; while STARTING: the first that arrived
        ("status", "u1"),
        ("kinds", "u1"),  # bit k: it has sent samples of KINDS[k]
        ("gap_allowed", "?"),  # the buffer has shed messages: do not wait for the missing ones
        ("used_ns", "i8"),  # last arrival
        ("least_ns", "i8"),  # least arrival minus time of this epoch, and of the one before; NONE_NS: not yet
        ("previous_least_ns", "i8"),
        ("epoch_end_ns", "i8"),
        ("newest_ns", "i8"),  # newest sample of its last message, on its own clock; 0: none yet
        ("arrival_ns", "i8"),
        ("shift_ns", "i8"),  # added to its times; for a UTC clock 0 until it jumps
        ("motion_shift_ns", "i8"),  # added to the times of its motion too: minus how far their clock is ahead
        ("ahead_ns", "i8"),  # how far that was in the last period; see `sensor_clocks.py`
        ("ahead_known", "?"),
        ("period_ns", "i8"),  # begin of the present period; 0: there is none
        ("delay_ns", "i8", 2),  # least arrival minus time in this period, of motion and of ranges
        ("kind_messages", "i4", 2),  # messages with motion, and with ranges, in this period
        ("kind_samples", "i4", 2),
        ("seen", "u8", _LANES),  # bit n % WINDOW: message n has arrived
    ],
    align=True,
)
NONE_NS: Final = np.iinfo(np.int64).max


@njit(nogil=True)
def _ahead(sequence: int, expected: int) -> int:
    """Return how far a number (u32, wraps) is ahead of the expected one."""
    distance: int = (np.int64(sequence) - np.int64(expected)) & 0xFFFFFFFF  # type: ignore[assignment]
    return distance - 2**32 if distance >= 2**31 else distance


@njit(nogil=True)
def _mark(publisher: Any, sequence: int, seen: bool) -> None:
    lane, bit = (sequence % WINDOW) // 64, np.uint64(1) << np.uint64(sequence % 64)
    if seen:
        publisher.seen[lane] |= bit
    else:
        publisher.seen[lane] &= ~bit


@njit(nogil=True)
def _was_seen(publisher: Any, sequence: int) -> bool:
    return bool((publisher.seen[(sequence % WINDOW) // 64] >> np.uint64(sequence % 64)) & np.uint64(1))


@njit(nogil=True)
def _begin(publisher: Any, sequence: int) -> None:
    """Start counting at this number."""
    for lane in range(_LANES):
        publisher.seen[lane] = 0
    _mark(publisher, sequence, True)
    publisher.next = np.uint32(sequence + 1)
    publisher.status = RUNNING


@njit(nogil=True)
def _advance(publisher: Any, sequence: int) -> int:
    """Pass a message that is not behind. Return how many before it are missing."""
    missing = _ahead(sequence, publisher.next)
    if missing >= WINDOW:
        _begin(publisher, sequence)
        return missing
    for k in range(missing):
        _mark(publisher, publisher.next + np.uint32(k), False)
    _mark(publisher, sequence, True)
    publisher.next = np.uint32(sequence + 1)
    return missing


@njit(nogil=True)
def _has_restarted(publisher: Any, ahead: int, arrival_ns: int) -> bool:
    """Return whether more messages are missing than the publisher can have sent since its last one passed."""
    if publisher.gap_allowed:
        return False
    silent_ns = max(arrival_ns - publisher.arrival_ns, 0) if publisher.arrival_ns != 0 else 0
    return bool(ahead > WINDOW + silent_ns // (1_000_000_000 // MESSAGES_PER_S))


@njit(nogil=True)
def _verdict(publisher: Any, sequence: int, arrival_ns: int) -> int:
    if publisher.status != RUNNING:
        if sequence != 0:
            return PENDING  # the publisher started earlier: older messages may follow
        _begin(publisher, sequence)
        return PASS
    ahead = _ahead(sequence, publisher.next)
    if -ahead > WINDOW or _has_restarted(publisher, ahead, arrival_ns):
        _begin(publisher, sequence)  # the publisher started counting again
        return PASS
    if ahead > 0:
        return PENDING
    if ahead == 0:
        _advance(publisher, sequence)
        return PASS
    if _was_seen(publisher, sequence):
        return DUPLICATE
    _mark(publisher, sequence, True)
    return PASS


@njit(nogil=True)
def _slot(publishers: Any, row: int, boot_id: int, sequence: int, arrival_ns: int) -> int:
    """Return the index of the publisher's state. A new one replaces the one that was silent for longest."""
    found = row * PER_TAG
    for slot in range(row * PER_TAG, (row + 1) * PER_TAG):
        publisher = publishers[slot]
        if publisher.status != UNUSED and publisher.boot_id == boot_id:
            publisher.used_ns = max(publisher.used_ns, arrival_ns)
            return slot
        if publisher.used_ns < publishers[found].used_ns:
            found = slot
    publisher = publishers[found]
    publisher.boot_id, publisher.next, publisher.status = boot_id, sequence, STARTING
    publisher.gap_allowed, publisher.used_ns, publisher.epoch_end_ns, publisher.kinds = False, arrival_ns, 0, 0
    publisher.least_ns = publisher.previous_least_ns = NONE_NS
    publisher.newest_ns = publisher.arrival_ns = publisher.shift_ns = 0
    publisher.motion_shift_ns = publisher.ahead_ns = publisher.period_ns = 0
    publisher.ahead_known = False
    return found


@njit(cache=True, nogil=True)
def pass_in_order(
    forms: Any, rows: Any, arrivals: Any, publishers: Any, slots: Any, distances: Any, verdicts: Any
) -> int:
    """Judge each message in order of arrival: PASS, PENDING, DUPLICATE or REFUSED. Return how many are pending.

    forms: FORM. publishers: PUBLISHER, PER_TAG for each row. slots: index of the publisher of each message, -1 for
    none. distances: how far the number of each is ahead of the expected one.
    """
    pending = 0
    for i in range(len(rows)):
        form = forms[i]
        slots[i], distances[i], verdicts[i] = -1, 0, PASS if form.accepted else REFUSED
        if not form.accepted:
            continue
        slots[i] = _slot(publishers, rows[i], form.boot_id, form.sequence, arrivals[i])
        if not form.numbered:
            continue
        publisher = publishers[slots[i]]
        distances[i] = _ahead(form.sequence, publisher.next)
        verdicts[i] = _verdict(publisher, form.sequence, arrivals[i])
        pending += verdicts[i] == PENDING
    return pending


@njit(nogil=True)
def _force(publisher: Any, sequence: int) -> int:
    """Pass a message although some before it are missing. Return how many."""
    if publisher.status != RUNNING:
        _begin(publisher, sequence)
        return 0
    return _advance(publisher, sequence)


@njit(cache=True, nogil=True)
def release(
    ordered: Any, slots: Any, forms: Any, arrivals: Any, publishers: Any, due_ns: Any, fresh: int, verdicts: Any
) -> int:
    """Judge the pending messages again, in the order of their numbers. Return how many missing ones are given up.

    All messages up to one that has waited long enough pass, and so do those that follow without a gap.

    ordered: the pending messages by publisher, then number. due_ns: of each message: if it arrived by then, it has
    waited long enough, unless it comes from a publisher that is RUNNING and is among those from index `fresh` on.
    """
    missing = 0
    begin = 0
    while begin < len(ordered):
        slot, end, forced = slots[ordered[begin]], begin, begin
        publisher = publishers[slot]
        while end < len(ordered) and slots[ordered[end]] == slot:
            newest = ordered[end]
            end += 1
            may_be_asked_for = newest >= fresh and publisher.status == RUNNING
            if publisher.gap_allowed or (arrivals[newest] <= due_ns[newest] and not may_be_asked_for):
                forced = end
        for k in range(begin, end):
            i = ordered[k]
            if forms[i].boot_id != publisher.boot_id:
                slots[i], verdicts[i] = -1, PASS  # newer publishers have taken the place of this one
                continue
            verdicts[i] = _verdict(publisher, forms[i].sequence, arrivals[i])
            if verdicts[i] == PENDING and k < forced:
                absent = _force(publisher, forms[i].sequence)
                missing += 0 if publisher.gap_allowed else absent
                verdicts[i] = PASS
        if forced > begin:
            publisher.gap_allowed = False
        begin = end
    return missing
