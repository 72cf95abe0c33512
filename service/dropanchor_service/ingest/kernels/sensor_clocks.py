"""Compare the clocks of a tag's motion and of its ranges, and find by how much to move the times of the motion.

The freshest message of a period tells a clock best: the least of arrival minus newest sample is the least delay minus
the error of the clock. Where one program sends both kinds, their delays are the same up to the time between two
samples, so the difference is the offset of both clocks; a backlog is as late in both. Where two programs send them,
the least delays of the last 30 to 60 s count, because a network may delay one of them for a while.

The times change only once two periods in a row agree, and only if the offset is larger than delays explain. Motion
from the future is moved at once.
"""

from typing import Any, Final

from numba import njit

from dropanchor_schemas.kinds import IMU, KINDS
from dropanchor_schemas.times import EARLIEST_UTC_NS
from dropanchor_service.ingest.kernels.sequences import NONE_NS, PER_TAG

MOTION: Final = 1 << KINDS.index(IMU)
RANGES: Final = 1 << [kind.name for kind in KINDS].index("range")
BOTH: Final = MOTION | RANGES

PERIOD_NS: Final = 2_000_000_000
MAX_PERIOD_NS: Final = 60_000_000_000
MIN_MESSAGES: Final = 4  # of each kind in a period
EXPLAINED_NS: Final = 300_000_000  # by delays, beside the time between two samples
FUTURE_NS: Final = 1_000_000_000  # ahead of the arrival: no delay explains it
AGREE_NS: Final = 100_000_000


@njit(nogil=True)
def _begin(publisher: Any, arrival_ns: int) -> None:
    publisher.period_ns = arrival_ns
    for kind in range(2):
        publisher.delay_ns[kind] = NONE_NS
        publisher.kind_messages[kind] = publisher.kind_samples[kind] = 0


@njit(nogil=True)
def _note(publisher: Any, kind: int, t_ns: int, samples: int, arrival_ns: int) -> None:
    """Note the newest of the samples of one kind in a message. One whose time cannot be UTC says nothing.

    The delays are those of the publisher's own clock: what it is off is the same for both kinds.
    """
    if t_ns < 0 or t_ns + publisher.shift_ns < EARLIEST_UTC_NS:
        return
    publisher.delay_ns[kind] = min(publisher.delay_ns[kind], arrival_ns - t_ns)
    publisher.kind_messages[kind] += 1
    publisher.kind_samples[kind] += samples


@njit(nogil=True)
def _is_over(publisher: Any, arrival_ns: int) -> bool:
    if arrival_ns - publisher.period_ns < PERIOD_NS:
        return False
    for kind in range(2):
        if publisher.kinds & (MOTION if kind == 0 else RANGES) and publisher.kind_messages[kind] < MIN_MESSAGES:
            return False
    return True


@njit(nogil=True)
def _delay_of(publisher: Any) -> int:
    """Return the least delay of a publisher in the last 30 to 60 s, as its own times tell it; NONE_NS: unknown."""
    least = min(publisher.least_ns, publisher.previous_least_ns)
    return int(least if least == NONE_NS else least - publisher.shift_ns + publisher.motion_shift_ns)


@njit(nogil=True)
def _ranges_beside(publishers: Any, slot: int, arrival_ns: int) -> int:
    """Return the index of the tag's publisher that sends ranges without motion and was heard last, -1 for none."""
    found, heard_ns = -1, arrival_ns - MAX_PERIOD_NS
    for other in range(slot - slot % PER_TAG, slot - slot % PER_TAG + PER_TAG):
        publisher = publishers[other]
        if publisher.kinds & BOTH == RANGES and publisher.arrival_ns > heard_ns:
            found, heard_ns = other, publisher.arrival_ns
    return found


@njit(nogil=True)
def _decide(publisher: Any, ahead_ns: int, explained_ns: int) -> bool:
    """Note by how much the motion was ahead in a period. Return whether its times have to be moved differently."""
    agreed = publisher.ahead_known and abs(ahead_ns - publisher.ahead_ns) <= AGREE_NS + explained_ns - EXPLAINED_NS
    publisher.ahead_ns, publisher.ahead_known = ahead_ns, True
    if not agreed or abs(ahead_ns + publisher.motion_shift_ns) <= explained_ns:
        return False
    wanted_ns = -ahead_ns if abs(ahead_ns) > explained_ns else 0
    changed = wanted_ns != publisher.motion_shift_ns
    publisher.motion_shift_ns = wanted_ns
    return bool(changed)


@njit(nogil=True)
def _judge(publishers: Any, slot: int, arrival_ns: int) -> bool:
    """Compare both kinds at the end of a period. Return whether the shift of the motion has changed."""
    publisher = publishers[slot]
    if publisher.kinds & BOTH == BOTH:
        if publisher.delay_ns[0] == NONE_NS or publisher.delay_ns[1] == NONE_NS:
            return False
        lasted_ns = arrival_ns - publisher.period_ns
        between_ns = lasted_ns // publisher.kind_samples[0] + lasted_ns // publisher.kind_samples[1]
        return _decide(publisher, publisher.delay_ns[1] - publisher.delay_ns[0], EXPLAINED_NS + between_ns)
    other = _ranges_beside(publishers, slot, arrival_ns) if publisher.kinds & MOTION else -1
    if other < 0 or _delay_of(publisher) == NONE_NS or _delay_of(publishers[other]) == NONE_NS:
        return False
    return _decide(publisher, _delay_of(publishers[other]) - _delay_of(publisher), EXPLAINED_NS + AGREE_NS)


@njit(nogil=True)
def first_shift(newest: Any, arrival_ns: int) -> int:
    """Return the shift of the motion that the first message of a UTC clock tells for certain; 0 if it tells none.

    Motion from the future beside ranges of the past needs no second message, and the tag keeps its start.
    """
    ahead_ns = newest[0] - newest[1]
    certain = newest[1] >= EARLIEST_UTC_NS and newest[1] <= arrival_ns and newest[0] > arrival_ns + FUTURE_NS
    return -int(ahead_ns) if certain and ahead_ns > FUTURE_NS else 0


@njit(nogil=True)
def compare(publishers: Any, slot: int, newest: Any, counts: Any, arrival_ns: int) -> bool:
    """Note a message. Return whether the times of the motion of its publisher are to be moved by another shift.

    newest: times of its newest motion and range, -1 for none. counts: of these.
    """
    publisher = publishers[slot]
    if publisher.period_ns == 0 or not 0 <= arrival_ns - publisher.period_ns <= MAX_PERIOD_NS:
        _begin(publisher, arrival_ns)
    for kind in range(2):
        _note(publisher, kind, newest[kind], counts[kind], arrival_ns)
    if not _is_over(publisher, arrival_ns):
        return False
    changed = _judge(publishers, slot, arrival_ns)
    _begin(publisher, arrival_ns)
    return changed
