"""Buffer messages between the threads that receive them and the thread that fuses them."""

from collections import Counter, deque
from collections.abc import Iterable
from itertools import compress
from operator import itemgetter
from threading import Event, Lock
from typing import NamedTuple

import numpy as np

from dropanchor_schemas.wire import COUNTS_AT, ENCODING_PACKED, HEADER
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.fair_share import fair_cap, sizes_from_newest
from dropanchor_service.store.rings import rank_in_row

Message = tuple[int, bytes, str, int]
"""Row of the tag, payload, encoding, arrival (UTC, ns)."""
UnregisteredMessage = tuple[str, bytes, str, int]
"""Key of a tag that has no row yet, payload, encoding, arrival (UTC, ns)."""

MESSAGE_OVERHEAD = 200  # bytes that a buffered message takes beside its payload
UNREGISTERED_BYTES = 8 * 2**20  # capacity for messages of tags without a row
UNREGISTERED_PER_TURN = 250  # each costs many times as much as a message of a registered tag
MAX_WAIT_NS = 500_000_000
CALM_NS = 2_000_000_000  # an overload ends after this time without shedding
_KEPT_SHARE = 0.75  # of the capacity, kept when the buffer is full, so that shedding is rare
_COUNT_WORDS = [at // 2 for at in COUNTS_AT]
_ROW, _PAYLOAD = itemgetter(0), itemgetter(1)


class Shed(NamedTuple):
    """Counts of what was dropped.

    by_row: messages of each row. samples: samples in those of these messages that were packed. unregistered: messages
    of tags without a row.
    """

    by_row: Counter[int]
    samples: int
    unregistered: int


class _Behind(NamedTuple):
    """When `drain` first left messages behind, and how long the oldest one had waited by then."""

    since_ns: int
    waited_ns: int


class MessageBuffer:
    """A queue in order of arrival, bounded in bytes and in waiting time.

    When it is full, the tags that fill it most lose their oldest messages.

    An overload begins when `drain` has been behind for `max_wait_ns` and messages wait longer and longer. It ends when
    `drain` has kept up for a while. During an overload the buffer keeps only what `drain` can take in half of
    `max_wait_ns`, but at least the newest message of each tag, and the tags take turns. A backlog from caches, or from
    a time without draining, is no overload: its messages and those behind them are all kept.

    Messages of tags without a row have a queue of their own, so a flood of them harms no registered tag.
    """

    def __init__(self, capacity_bytes: int, max_wait_ns: int = MAX_WAIT_NS) -> None:
        self._capacity_bytes = capacity_bytes
        self._max_wait_ns = max_wait_ns
        self._lock = Lock()
        self._filled = Event()
        self._woken = False
        self._rows: dict[str, int] = {}
        self._messages: list[Message] = []
        self._bytes = 0
        self._unregistered: deque[UnregisteredMessage] = deque()
        self._unregistered_bytes = 0
        self._shed: Counter[int] = Counter()
        self._shed_samples = 0
        self._unregistered_shed = 0
        self._cached = 0  # messages up to the last one from a cache
        self._behind: _Behind | None = None
        self._drained_bytes = 0  # since it fell behind
        self._bytes_per_ns = 0.0  # drained while it was behind
        self._overloaded = False
        self._shed_ns = 0  # UTC of the last shedding due to an overload
        self._drains = 0
        self._served = np.zeros(
            0, np.int64
        )  # by row: number of the last drain in an overload that took one of its messages

    def append(self, key: str, payload: bytes, encoding: str, arrival_ns: int, cached: bool = False) -> None:
        """Add a message. Thread-safe; blocks for no longer than shedding takes.

        cached: the message comes from a cache, and may be old.
        """
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
        """Register a key: its messages belong to `row` from now on."""
        self._rows[key] = row

    def forget(self, key: str) -> None:
        """Treat the messages of a key as those of an unregistered tag from now on."""
        self._rows.pop(key, None)

    def row_of(self, key: str) -> int | None:
        """Return the row of a key, None for one that is not registered."""
        return self._rows.get(key)

    def wait(self, timeout_s: float) -> bool:
        """Wait for a message or `wake`. Return False if neither comes within `timeout_s`."""
        came = self._filled.wait(timeout_s)
        self._woken = False
        return came

    def wake(self) -> None:
        """End a wait, the present or the next one. Any thread may call this."""
        self._woken = True
        self._filled.set()

    def drain(self, limit: int, now_ns: int = 0) -> tuple[list[Message], list[UnregisteredMessage]]:
        """Take out up to `limit` messages of registered tags, and up to UNREGISTERED_PER_TURN others.

        The messages of each tag stay in their order. now_ns: UTC.
        """
        with self._lock:
            taken = self._next(limit, now_ns)
            self._cached = max(0, self._cached - len(taken))
            self._drained_bytes += _size_of_all(taken) if self._behind else 0
            unregistered = [
                self._unregistered.popleft() for _ in range(min(UNREGISTERED_PER_TURN, len(self._unregistered)))
            ]
            self._unregistered_bytes -= sum(map(_size, unregistered))
            if not self._messages and not self._unregistered and not self._woken:
                self._filled.clear()
            return taken, unregistered

    def take_shed(self) -> Shed:
        """Return the counts of what was dropped since the last call."""
        with self._lock:
            shed = Shed(self._shed, self._shed_samples, self._unregistered_shed)
            self._shed, self._shed_samples, self._unregistered_shed = Counter(), 0, 0
            return shed

    @property
    def depth(self) -> int:
        """Number of messages in the buffer."""
        return len(self._messages) + len(self._unregistered)

    @property
    def is_overloaded(self) -> bool:
        """Whether messages come faster than `drain` takes them, for a while now."""
        return self._overloaded

    def _append_unregistered(self, message: UnregisteredMessage) -> None:
        self._unregistered.append(message)
        self._unregistered_bytes += _size(message)
        while self._unregistered_bytes > UNREGISTERED_BYTES:
            self._unregistered_bytes -= _size(self._unregistered.popleft())
            self._unregistered_shed += 1

    def _next(self, limit: int, now_ns: int) -> list[Message]:
        """Take out the messages for `drain`. In an overload, shed others."""
        if len(self._messages) > limit and self._is_overload(now_ns):
            rows, sizes = self._keep_newest(self._bytes_per_ns * self._max_wait_ns / 2, now_ns)
            if len(rows) > limit:
                return self._take(self._next_in_turn(limit, rows), sizes)
        if len(self._messages) > limit:
            taken, self._messages = self._messages[:limit], self._messages[limit:]
            self._bytes -= _size_of_all(taken)
            return taken
        taken, self._messages, self._bytes = self._messages, [], 0
        self._behind, self._overloaded = None, self._overloaded and now_ns - self._shed_ns < CALM_NS
        return taken

    def _is_overload(self, now_ns: int) -> bool:
        """Update how far behind `drain` is, and return whether that is an overload."""
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
        """Keep the newest message of every tag, and as many more as fit into `target_bytes`. Shed the others.

        Returns the row and the size of each message that is kept.
        """
        rows, sizes = self._columns()
        kept = _newest(rows, sizes, target_bytes)
        if not kept.all():
            self._shed_all_but(kept, sizes)
            self._shed_ns = now_ns
        return rows[kept], sizes[kept]

    def _make_room(self, target_bytes: float) -> None:
        rows, sizes = self._columns()
        kept = _newest(rows, sizes, target_bytes)
        total = np.cumsum(np.where(kept, sizes, 0)[::-1])[::-1]
        self._shed_all_but(kept & (total <= target_bytes), sizes)

    def _shed_all_but(self, kept: Array, sizes: Array) -> None:
        self._cached = int(kept[: self._cached].sum())
        lost = self._take(np.flatnonzero(~kept), sizes)
        self._shed.update(map(_ROW, lost))
        self._shed_samples += _samples_of(lost)

    def _next_in_turn(self, limit: int, rows: Array) -> Array:
        """Return the indices of up to `limit` messages, of the tags that have waited longest for their turn.

        rows: row of each buffered message.
        """
        self._drains += 1
        missing = int(rows.max()) + 1 - len(self._served)
        if missing > 0:
            self._served = np.concatenate([self._served, np.zeros(missing, np.int64)])
        turns = self._served[rows] + rank_in_row(rows)
        chosen = np.sort(np.argsort(turns, kind="stable")[:limit])
        self._served[rows[chosen]] = self._drains
        return chosen

    def _take(self, chosen: Array, sizes: Array) -> list[Message]:
        """Take out the messages with the indices `chosen`, in their order. sizes: of all buffered messages."""
        stays = np.ones(len(self._messages), bool)
        stays[chosen] = False
        taken = list(compress(self._messages, (~stays).tolist()))
        self._messages = list(compress(self._messages, stays.tolist()))
        self._bytes -= int(sizes[chosen].sum())
        return taken

    def _columns(self) -> tuple[Array, Array]:
        """Return the row and the size of each message."""
        count = len(self._messages)
        sizes = np.fromiter(map(len, map(_PAYLOAD, self._messages)), np.int64, count)
        return np.fromiter(map(_ROW, self._messages), np.int64, count), sizes + MESSAGE_OVERHEAD


def _size(message: Message | UnregisteredMessage) -> int:
    return len(message[1]) + MESSAGE_OVERHEAD


def _size_of_all(messages: list[Message]) -> int:
    return sum(map(len, map(_PAYLOAD, messages))) + MESSAGE_OVERHEAD * len(messages)


def _newest(rows: Array, sizes: Array, target_bytes: float) -> Array:
    """Return which messages are their tag's newest, or within its fair share of `target_bytes`."""
    newer = sizes_from_newest(rows, sizes)
    newest: Array = (newer <= fair_cap(np.bincount(rows, sizes), target_bytes)) | (newer == sizes)
    return newest


def _samples_of(messages: Iterable[Message]) -> int:
    """Count the samples in the packed ones of these messages, from their headers."""
    headers = b"".join(m[1][: HEADER.size] for m in messages if m[2] == ENCODING_PACKED and len(m[1]) >= HEADER.size)
    words = np.frombuffer(headers, "<u2").reshape(-1, HEADER.size // 2)
    return int(words[:, _COUNT_WORDS].sum())
