"""What is known of each publisher of a tag: its clock, and which of its messages have come already."""

import time
from collections import OrderedDict

PUBLISHERS_PER_TAG = 4
WINDOW = 1024  # messages behind the newest in which a duplicate is recognised
EPOCH_NS = 30_000_000_000
_ALL_SEEN = (1 << WINDOW) - 1


class Publisher:
    """One start of one publisher, known by its boot id."""

    __slots__ = ("_epoch_end_ns", "_least_ns", "_newest", "_previous_least_ns", "_seen")

    def __init__(self) -> None:
        self._newest: int | None = None
        self._seen = 0  # bit i: the message i before the newest has come
        self._least_ns: int | None = None
        self._previous_least_ns: int | None = None
        self._epoch_end_ns = 0

    def is_new(self, sequence: int) -> bool:
        """Whether the message with this number (u32, wraps) comes for the first time.

        One further back than the window is taken for a publisher that counts from the start again.
        """
        if self._newest is None:
            self._newest, self._seen = sequence, 1
            return True
        ahead = (sequence - self._newest + 2**31) % 2**32 - 2**31
        if ahead > 0:
            self._seen = (self._seen << min(ahead, WINDOW) | 1) & _ALL_SEEN
            self._newest = sequence
            return True
        if -ahead >= WINDOW:
            self._newest, self._seen = sequence, 1
            return True
        bit = 1 << -ahead
        new = not self._seen & bit
        self._seen |= bit
        return new

    def utc_offset_ns(self, newest_ns: int, arrival_ns: int) -> int:
        """UTC minus this publisher's clock: the least seen between a sample's own time and its arrival.

        The message with the least delay tells most. The least of the last 30 to 60 s follows a drifting crystal.
        """
        delay_ns = arrival_ns - newest_ns
        if arrival_ns >= self._epoch_end_ns:
            self._previous_least_ns, self._least_ns = self._least_ns, None
            self._epoch_end_ns = arrival_ns + EPOCH_NS
        self._least_ns = delay_ns if self._least_ns is None else min(self._least_ns, delay_ns)
        if self._previous_least_ns is None:
            return self._least_ns
        return min(self._least_ns, self._previous_least_ns)


class Publishers:
    """The last few publishers of every tag; memory is bounded whatever boot ids a tag makes up."""

    def __init__(self) -> None:
        self._by_row: dict[int, OrderedDict[int, Publisher]] = {}

    def of(self, row: int, boot_id: int) -> Publisher:
        """The publisher, made when it is new; the one unheard for longest makes room."""
        known = self._by_row.setdefault(row, OrderedDict())
        publisher = known.get(boot_id)
        if publisher is None:
            publisher = known[boot_id] = Publisher()
            if len(known) > PUBLISHERS_PER_TAG:
                known.popitem(last=False)
        elif len(known) > 1:
            known.move_to_end(boot_id)
        return publisher


class UtcClock:
    """UTC as the host had it at the start, carried on by its monotonic clock: steps of the host's clock do nothing."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        return time.monotonic_ns() + self._offset_ns
