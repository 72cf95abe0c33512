"""Messages between the threads that receive them and the one that fuses them."""

from collections import Counter, deque
from collections.abc import Sequence
from itertools import compress
from threading import Event, Lock

import numpy as np

from dropanchor_service.estimation.batch import Array

Message = tuple[int, bytes, str, int]
"""Row of the tag, payload, encoding, UTC of arrival in ns."""
Stranger = tuple[str, bytes, str, int]
"""The same of a key that has no row yet."""

MESSAGE_OVERHEAD = 200  # bytes that a waiting message takes beside its payload
STRANGER_BYTES = 8 * 2**20  # of messages of tags without a row that may wait
STRANGERS_PER_TURN = 250  # of them at a time: each costs many times as much as a message of a known tag
_KEPT_SHARE = 0.75  # of what may wait after shedding, so that shedding is rare
PATIENCE_NS = 1_000_000_000  # of falling behind, before it counts as overload
MOST_WAIT_S = 0.5  # for a message in an overload
_JUST_NS = 100_000_000


class MessageBuffer:
    """Bounded. When it is full, the tags that fill it most lose their oldest messages.

    So they do in an overload: when `drain` has not caught up for PATIENCE_NS, no more may wait than it takes in
    MOST_WAIT_S. Messages that arrived before it fell behind, from a cache or while nobody drained, start that time
    afresh: a burst is no overload.

    Keys that are not known wait apart, where only they push out each other: a flood of them harms no known tag.
    """

    def __init__(self, capacity_bytes: int) -> None:
        self._capacity_bytes = capacity_bytes
        self._lock = Lock()
        self._filled = Event()
        self._rows: dict[str, int] = {}
        self._messages: list[Message] = []
        self._bytes = 0
        self._strangers: deque[Stranger] = deque()
        self._stranger_bytes = 0
        self._shed: Counter[int] = Counter()
        self._strangers_shed = 0
        self._behind_ns: int | None = None  # since when `drain` has left something
        self._drained_bytes = 0  # since then

    def append(self, key: str, payload: bytes, encoding: str, arrival_ns: int) -> None:
        """From any thread; blocks for no longer than shedding takes."""
        row = self._rows.get(key)
        with self._lock:
            if row is not None:
                self._messages.append((row, payload, encoding, arrival_ns))
                self._bytes += len(payload) + MESSAGE_OVERHEAD
                if self._bytes > self._capacity_bytes:
                    self._shed_down_to(_KEPT_SHARE * self._capacity_bytes)
            else:
                self._append_stranger((key, payload, encoding, arrival_ns))
        if not self._filled.is_set():
            self._filled.set()

    def admit(self, key: str, row: int) -> None:
        """This key is known from now on."""
        self._rows[key] = row

    def row_of(self, key: str) -> int | None:
        """None of a stranger."""
        return self._rows.get(key)

    def wait(self, timeout_s: float) -> bool:
        """Until there is a message; False when there is none in time."""
        return self._filled.wait(timeout_s)

    def drain(self, most: int, now_ns: int = 0) -> tuple[list[Message], list[Stranger]]:
        """The oldest messages of known keys, at most so many, and of strangers. now_ns: UTC."""
        with self._lock:
            if len(self._messages) <= most:
                taken, self._messages, self._bytes = self._messages, [], 0
                self._behind_ns = None
            else:
                taken = self._messages[:most]
                del self._messages[:most]
                size = sum(map(_size, taken))
                self._bytes -= size
                self._fall_behind(size, taken[0][3], now_ns)
            strangers = [self._strangers.popleft() for _ in range(min(STRANGERS_PER_TURN, len(self._strangers)))]
            self._stranger_bytes -= sum(map(_size, strangers))
            if not self._messages and not self._strangers:
                self._filled.clear()
            return taken, strangers

    def take_shed(self) -> tuple[Counter[int], int]:
        """Messages lost since the last call: by row, and of strangers."""
        with self._lock:
            shed = self._shed, self._strangers_shed
            self._shed, self._strangers_shed = Counter(), 0
            return shed

    @property
    def depth(self) -> int:
        return len(self._messages) + len(self._strangers)

    def _append_stranger(self, message: Stranger) -> None:
        self._strangers.append(message)
        self._stranger_bytes += _size(message)
        while self._stranger_bytes > STRANGER_BYTES:
            self._stranger_bytes -= _size(self._strangers.popleft())
            self._strangers_shed += 1

    def _fall_behind(self, taken_bytes: int, oldest_ns: int, now_ns: int) -> None:
        if self._behind_ns is None or oldest_ns < self._behind_ns - _JUST_NS:
            self._behind_ns, self._drained_bytes = now_ns, 0
            return
        self._drained_bytes += taken_bytes
        behind_ns = now_ns - self._behind_ns
        if behind_ns > PATIENCE_NS:
            may_wait = MOST_WAIT_S * self._drained_bytes / (behind_ns * 1e-9)
            if self._bytes > may_wait:
                self._shed_down_to(_KEPT_SHARE * may_wait)

    def _shed_down_to(self, target_bytes: float) -> None:
        rows = np.array([message[0] for message in self._messages])
        sizes = np.array([_size(message) for message in self._messages])
        _, tags = np.unique(rows, return_inverse=True)
        cap = _fair_cap(np.bincount(tags, sizes), int(target_bytes))
        kept = _newer_of_same(tags, sizes) <= cap
        lost, counts = np.unique(rows[~kept], return_counts=True)
        self._shed.update(dict(zip(lost.tolist(), counts.tolist(), strict=True)))
        self._messages = list(compress(self._messages, kept.tolist()))
        self._bytes = int(sizes[kept].sum())


def _size(message: Message | Stranger) -> int:
    return len(message[1]) + MESSAGE_OVERHEAD


def _newer_of_same(tags: Array, sizes: Array) -> Array:
    """The sum of the sizes of each message and of all newer ones of its tag."""
    order = np.argsort(tags[::-1], kind="stable")
    ordered, summed = tags[::-1][order], np.cumsum(sizes[::-1][order])
    first = np.append(True, ordered[1:] != ordered[:-1])
    before = (summed - sizes[::-1][order])[first]
    sums = np.empty(len(tags), np.int64)
    sums[order] = summed - before[np.cumsum(first) - 1]
    return sums[::-1]


def _fair_cap(sizes: Array, target: int) -> int:
    """The largest share c with sum(min(size, c)) <= target."""
    left = target
    ascending: Sequence[float] = np.sort(sizes).tolist()
    for index, size in enumerate(ascending):
        share = left // (len(ascending) - index)
        if size > share:
            return int(share)
        left -= int(size)
    return target
