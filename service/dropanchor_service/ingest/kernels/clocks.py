"""Publishers' clocks to our UTC: those that count from a start, and those that are UTC but jump.

A clock is judged by its publisher's messages in the order of their numbers: the time of each one's newest sample
against its arrival. Delay alone is no error: a backlog of minutes comes in order, its times going on.
"""

from typing import Any, Final

from numba import njit

from dropanchor_service.ingest.kernels.sequences import NONE_NS

EPOCH_NS: Final = 30_000_000_000
BACK_NS: Final = 2_000_000_000  # a clock that goes back farther was set
AHEAD_NS: Final = 10_000_000_000  # of our own UTC: nobody measures in the future
NEVER_SET_NS: Final = 1_577_836_800_000_000_000  # 2020: a UTC before is that of a clock nobody has set


@njit(nogil=True)
def _since_start(publisher: Any, t_ns: int, arrival_ns: int) -> int:
    """UTC minus a clock that counts from some start: the least difference seen between a message's newest sample and
    its arrival, as the message with the least delay tells most. The least of the last 30 to 60 s follows a drifting
    crystal."""
    if publisher.heard_ns != 0 and t_ns < publisher.newest_ns - BACK_NS:
        publisher.least_ns = publisher.previous_least_ns = NONE_NS
        publisher.epoch_end_ns = 0
    if arrival_ns >= publisher.epoch_end_ns:
        publisher.previous_least_ns, publisher.least_ns = publisher.least_ns, NONE_NS
        publisher.epoch_end_ns = arrival_ns + EPOCH_NS
    publisher.least_ns = min(publisher.least_ns, arrival_ns - t_ns)
    return int(min(publisher.least_ns, publisher.previous_least_ns))


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


@njit(cache=True, nogil=True)
def utc_offsets(forms: Any, slots: Any, newest: Any, arrivals: Any, chosen: Any, publishers: Any, offsets: Any) -> int:
    """UTC minus the publisher's clock for the messages `chosen`, in this order, ns. Returns how many clocks jumped.

    newest: time of each message's newest sample, ns, negative without one. slots: its publisher, -1 without one.
    """
    jumps = 0
    for i in chosen:
        if slots[i] < 0 or newest[i] < 0:
            continue
        publisher = publishers[slots[i]]
        if forms[i].boot_clock:
            offsets[i] = _since_start(publisher, newest[i], arrivals[i])
        else:
            offsets[i] = _shift(publisher, newest[i], arrivals[i])
            jumps += offsets[i] != publisher.shift_ns
            publisher.shift_ns = offsets[i]
        publisher.newest_ns, publisher.heard_ns = newest[i], arrivals[i]
    return jumps
