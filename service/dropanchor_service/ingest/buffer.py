"""Messages between the threads that receive them and the one that fuses them."""

from collections import Counter, deque
from collections.abc import Iterable
from itertools import compress
from operator import itemgetter
from threading import Event, Lock
from typing import NamedTuple

import numpy as np

from dropanchor_schemas.wire import ENCODING_PACKED, HEADER
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.fair_share import fair_cap, newer_of_same
from dropanchor_service.store.rings import rank_in_row

Message = tuple[int, bytes, str, int]
"""Row of the tag, payload, encoding, UTC of arrival in ns."""
UnregisteredMessage = tuple[str, bytes, str, int]
"""The same of a key that has no row yet."""

MESSAGE_OVERHEAD = 200  # bytes that a waiting message takes beside its payload
UNREGISTERED_BYTES = 8 * 2**20  # of messages of tags without a row that may wait
UNREGISTERED_PER_TURN = 250  # of them at a time: each costs many times as much as a message of a known tag
MAX_WAIT_NS = 500_000_000
CALM_NS = 2_000_000_000  # without shedding anything: then an overload is over
_KEPT_SHARE = 0.75  # of what may wait after shedding for room, so that it is rare
_COUNTS = np.dtype({"names": ["some", "bearing"], "formats": [("<u2", 3), "<u2"], "offsets": [2, 24], "itemsize": 32})
_ROW, _PAYLOAD = itemgetter(0), itemgetter(1)


class Shed(NamedTuple):
    """What was lost. by_row: messages. samples: in those of them that were packed. unregistered: their messages."""

    by_row: Counter[int]
    samples: int
    unregistered: int


class _Behind(NamedTuple):
    """Since when `drain` has left something, and for how long the oldest message had waited then."""

    since_ns: int
    waited_ns: int


class MessageBuffer:
    """In the order of arrival, as long as `drain` keeps up with it.

    It is bounded in bytes: when it is full, the tags that fill it most lose their oldest messages. And in time: when
    `drain` has not caught up for `max_wait_ns` and what it takes waits longer and longer, that is an overload. Until
    it has caught up for a while, only so much waits as it can take in half that time, at least the newest message of
    each tag, and the tags take turns. What comes from caches, or came while nobody drained, is no overload: it waits
    for as long as it takes, and others behind it.

    Keys that are not known wait apart, where only they push out each other: a flood of them harms no known tag.
    """

    def __init__(self, capacity_bytes: int, max_wait_ns: int = MAX_WAIT_NS) -> None:
        self._capacity_bytes = capacity_bytes
        self._max_wait_ns = max_wait_ns
        self._lock = Lock()
        self._filled = Event()
        self._rows: dict[str, int] = {}
        self._messages: list[Message] = []
        self._bytes = 0
        self._unregistered: deque[UnregisteredMessage] = deque()
        self._unregistered_bytes = 0
        self._shed: Counter[int] = Counter()
        self._shed_samples = 0
        self._unregistered_shed = 0
        self._cached = 0  # messages up to the last one that a cache gave
        self._behind: _Behind | None = None
        self._drained_bytes = 0  # since then
        self._bytes_per_ns = 0.0  # that were drained while it was behind
        self._overloaded = False
        self._shed_ns = 0  # UTC of the last time that it shed because of that
        self._drains = 0
        self._served = np.zeros(0, np.int64)  # by row: the last drain in an overload that took something of it

    def append(self, key: str, payload: bytes, encoding: str, arrival_ns: int, cached: bool = False) -> None:
        """From any thread; blocks for no longer than shedding takes. cached: it was not published just now."""
        row = self._rows.get(key)
        with self._lock:
            if row is not None:
                self._messages.append((row, payload, encoding, arrival_ns))
                self._bytes += len(payload) + MESSAGE_OVERHEAD
                if cached:
                    self._cached = len(self._messages)
                if self._bytes > self._capacity_bytes:
                    self._make_room(_KEPT_SHARE * self._capacity_bytes)
            else:
                self._append_unregistered((key, payload, encoding, arrival_ns))
        if not self._filled.is_set():
            self._filled.set()

    def admit(self, key: str, row: int) -> None:
        """This key is known from now on."""
        self._rows[key] = row

    def row_of(self, key: str) -> int | None:
        """None of a unregistered."""
        return self._rows.get(key)

    def wait(self, timeout_s: float) -> bool:
        """Until there is a message; False when there is none in time."""
        return self._filled.wait(timeout_s)

    def drain(self, most: int, now_ns: int = 0) -> tuple[list[Message], list[UnregisteredMessage]]:
        """At most so many messages of known keys, each tag's in their order, and of unregistered. now_ns: UTC."""
        with self._lock:
            taken = self._next(most, now_ns)
            self._cached = max(0, self._cached - len(taken))
            self._drained_bytes += _size_of_all(taken) if self._behind else 0
            unregistered = [
                self._unregistered.popleft() for _ in range(min(UNREGISTERED_PER_TURN, len(self._unregistered)))
            ]
            self._unregistered_bytes -= sum(map(_size, unregistered))
            if not self._messages and not self._unregistered:
                self._filled.clear()
            return taken, unregistered

    def take_shed(self) -> Shed:
        """What was lost since the last call."""
        with self._lock:
            shed = Shed(self._shed, self._shed_samples, self._unregistered_shed)
            self._shed, self._shed_samples, self._unregistered_shed = Counter(), 0, 0
            return shed

    @property
    def depth(self) -> int:
        return len(self._messages) + len(self._unregistered)

    def _append_unregistered(self, message: UnregisteredMessage) -> None:
        self._unregistered.append(message)
        self._unregistered_bytes += _size(message)
        while self._unregistered_bytes > UNREGISTERED_BYTES:
            self._unregistered_bytes -= _size(self._unregistered.popleft())
            self._unregistered_shed += 1

    def _next(self, most: int, now_ns: int) -> list[Message]:
        """Those that `drain` takes, and in an overload others are shed."""
        if len(self._messages) > most and self._is_overload(now_ns):
            rows, sizes = self._keep_newest(self._bytes_per_ns * self._max_wait_ns / 2, now_ns)
            if len(rows) > most:
                return self._take(self._next_in_turn(most, rows), sizes)
        if len(self._messages) > most:
            taken, self._messages = self._messages[:most], self._messages[most:]
            self._bytes -= _size_of_all(taken)
            return taken
        taken, self._messages, self._bytes = self._messages, [], 0
        self._behind, self._overloaded = None, self._overloaded and now_ns - self._shed_ns < CALM_NS
        return taken

    def _is_overload(self, now_ns: int) -> bool:
        """Follow how far `drain` is behind, and for how long."""
        waited_ns = now_ns - self._messages[0][3]
        if self._cached:
            self._behind, self._overloaded = None, False
        if self._behind is None:
            self._behind, self._drained_bytes = _Behind(now_ns, waited_ns), 0
        behind_ns = now_ns - self._behind.since_ns
        if min(behind_ns, waited_ns - max(0, self._behind.waited_ns)) > self._max_wait_ns:
            self._overloaded = True
        if self._drained_bytes and behind_ns > 0:
            self._bytes_per_ns = self._drained_bytes / behind_ns
        return self._overloaded

    def _keep_newest(self, target_bytes: float, now_ns: int) -> tuple[Array, Array]:
        """Of every tag the newest message, and more where all together are no more than this. Returns row and size of
        each of them."""
        rows, sizes = self._columns()
        kept = _newest(rows, sizes, target_bytes)
        if not kept.all():
            self._shed_but(kept, sizes)
            self._shed_ns = now_ns
        return rows[kept], sizes[kept]

    def _make_room(self, target_bytes: float) -> None:
        rows, sizes = self._columns()
        kept = _newest(rows, sizes, target_bytes)
        total = np.cumsum(np.where(kept, sizes, 0)[::-1])[::-1]
        self._shed_but(kept & (total <= target_bytes), sizes)

    def _shed_but(self, kept: Array, sizes: Array) -> None:
        self._cached = int(kept[: self._cached].sum())
        lost = self._take(np.flatnonzero(~kept), sizes)
        self._shed.update(map(_ROW, lost))
        self._shed_samples += _samples_of(lost)

    def _next_in_turn(self, most: int, rows: Array) -> Array:
        """So many messages of the tags that have waited for their turn longest. rows: of all that wait."""
        self._drains += 1
        missing = int(rows.max()) + 1 - len(self._served)
        if missing > 0:
            self._served = np.concatenate([self._served, np.zeros(missing, np.int64)])
        turns = self._served[rows] + rank_in_row(rows)
        chosen = np.sort(np.argsort(turns, kind="stable")[:most])
        self._served[rows[chosen]] = self._drains
        return chosen

    def _take(self, chosen: Array, sizes: Array) -> list[Message]:
        """Out of the waiting ones, which have these sizes, in their order."""
        stays = np.ones(len(self._messages), bool)
        stays[chosen] = False
        taken = list(compress(self._messages, (~stays).tolist()))
        self._messages = list(compress(self._messages, stays.tolist()))
        self._bytes -= int(sizes[chosen].sum())
        return taken

    def _columns(self) -> tuple[Array, Array]:
        """Row and size of each message."""
        count = len(self._messages)
        sizes = np.fromiter(map(len, map(_PAYLOAD, self._messages)), np.int64, count)
        return np.fromiter(map(_ROW, self._messages), np.int64, count), sizes + MESSAGE_OVERHEAD


def _size(message: Message | UnregisteredMessage) -> int:
    return len(message[1]) + MESSAGE_OVERHEAD


def _size_of_all(messages: list[Message]) -> int:
    return sum(map(len, map(_PAYLOAD, messages))) + MESSAGE_OVERHEAD * len(messages)


def _newest(rows: Array, sizes: Array, target_bytes: float) -> Array:
    """Whether each is its tag's newest, or belongs to a fair share of so many bytes."""
    newer = newer_of_same(rows, sizes)
    newest: Array = (newer <= fair_cap(np.bincount(rows, sizes), target_bytes)) | (newer == sizes)
    return newest


def _samples_of(messages: Iterable[Message]) -> int:
    """In those that are packed, by their headers."""
    headers = b"".join(m[1][: HEADER.size] for m in messages if m[2] == ENCODING_PACKED and len(m[1]) >= HEADER.size)
    counts = np.frombuffer(headers, _COUNTS)
    return int(counts["some"].sum() + counts["bearing"].sum())
