"""Buffer messages between the threads that receive them and the thread that fuses them."""

from collections import Counter, deque
from collections.abc import Iterable
from threading import Event, Lock
from typing import NamedTuple

import numpy as np

from dropanchor_schemas.wire import COUNTS_AT, ENCODING_PACKED, HEADER
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.backlog import MESSAGE_OVERHEAD, PAYLOAD, ROW, Backlog, Message, most_of_a_row, moved
from dropanchor_service.ingest.fair_share import fair_cap, sizes_from_newest
from dropanchor_service.ingest.overload import Overload

UnregisteredMessage = tuple[str, bytes, str, int]
"""Key of a tag that has no row yet, payload, encoding, arrival (UTC, ns)."""

UNREGISTERED_BYTES = 8 * 2**20  # capacity for messages of tags without a row
UNREGISTERED_PER_TURN = 250  # each costs many times as much as a message of a registered tag
PER_TURN_OF_TAG = 16  # messages of a tag in a turn: each is a batch of its own, and all tags wait for the last batch
MAX_WAIT_NS = 500_000_000
BURST_WAITS = 8  # times MAX_WAIT_NS: a backlog of single tags that still grows after this is shed
_KEPT_SHARE = 0.75  # of the capacity, kept when the buffer is full, so that shedding is rare
_COUNT_WORDS = [at // 2 for at in COUNTS_AT]


class Shed(NamedTuple):
    """Counts of what was dropped.

    by_row: messages of each row. samples: samples in those of these messages that were packed. unregistered: messages
    of tags without a row.
    """

    by_row: Counter[int]
    samples: int
    unregistered: int


class MessageBuffer:
    """A queue in order of arrival, bounded in bytes and in waiting time.

    A turn takes up to PER_TURN_OF_TAG messages of a tag. What it leaves behind waits in the `Backlog`, of which the
    tags take turns, so that the burst of one tag delays no other.

    When the buffer is full, the tags that fill it most lose their oldest messages.

    An overload begins when `drain` has been behind for `max_wait_ns` and messages wait longer and longer. It ends when
    `drain` has kept up for a while. During an overload the buffer keeps only what `drain` can take in half of
    `max_wait_ns`, but at least the newest message of each tag. A backlog from caches, or from a time without draining,
    is no overload: its messages and those behind them are all kept. So is a burst of single tags, unless it goes on.

    Messages of tags without a row have a queue of their own, so a flood of them harms no registered tag.
    """

    def __init__(self, capacity_bytes: int, max_wait_ns: int = MAX_WAIT_NS) -> None:
        self._capacity_bytes = capacity_bytes
        self._max_wait_ns = max_wait_ns
        self._lock = Lock()
        self._filled = Event()
        self._woken = False
        self._rows: dict[str, int] = {}
        self._messages: list[Message] = []  # since the last drain
        self._backlog = Backlog()
        self._bytes = 0
        self._unregistered: deque[UnregisteredMessage] = deque()
        self._unregistered_bytes = 0
        self._shed: Counter[int] = Counter()
        self._shed_samples = 0
        self._unregistered_shed = 0
        self._cached = 0  # messages up to the last one from a cache
        self._overload = Overload(max_wait_ns)
        self._of_single_tags = Overload(BURST_WAITS * max_wait_ns, may_shrink=True)

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
                    self._cached = len(self._messages) + len(self._backlog)
                if self._bytes > self._capacity_bytes:
                    self._make_room(_KEPT_SHARE * self._capacity_bytes)
            else:
                self._append_unregistered((key, payload, encoding, arrival_ns))
        if not self._filled.is_set():
            self._filled.set()

    def admit(self, key: str, row: int) -> None:
        """Register a key: its messages belong to `row` from now on."""
        self._rows[key] = row

    def move_arrivals(self, by_ns: int) -> None:
        """Follow the clock that tells arrivals, which was moved. Messages have not waited for longer."""
        with self._lock:
            self._messages = list(moved(self._messages, by_ns))
            self._unregistered = deque((*message[:3], message[3] + by_ns) for message in self._unregistered)
            self._backlog.move_arrivals(by_ns)
            self._overload.end()
            self._of_single_tags.end()

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
            unregistered = [
                self._unregistered.popleft() for _ in range(min(UNREGISTERED_PER_TURN, len(self._unregistered)))
            ]
            self._unregistered_bytes -= sum(map(_size, unregistered))
            if not self._backlog and not self._unregistered and not self._woken:
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
        return len(self._messages) + len(self._backlog) + len(self._unregistered)

    @property
    def behind(self) -> frozenset[int]:
        """Rows of which the last drain left messages behind."""
        return self._backlog.rows

    @property
    def is_overloaded(self) -> bool:
        """Whether messages come faster than `drain` takes them, for a while now."""
        return self._overload.is_on

    def _append_unregistered(self, message: UnregisteredMessage) -> None:
        self._unregistered.append(message)
        self._unregistered_bytes += _size(message)
        while self._unregistered_bytes > UNREGISTERED_BYTES:
            self._unregistered_bytes -= _size(self._unregistered.popleft())
            self._unregistered_shed += 1

    def _next(self, limit: int, now_ns: int) -> list[Message]:
        """Take out the messages for `drain`. In an overload, shed others."""
        fresh, self._messages = self._messages, []
        if not self._backlog and len(fresh) <= limit and _is_fair(fresh):
            taken, self._bytes = fresh, 0
        else:
            self._backlog.add(fresh)
            self._shed_overload(limit, now_ns)
            taken = self._backlog.take(limit, PER_TURN_OF_TAG)
            size = _size_of_all(taken)
            self._bytes -= size
            self._overload.note_drained(size)
            self._of_single_tags.note_drained(size)
        if not self._backlog:
            self._overload.caught_up(now_ns)
            self._of_single_tags.caught_up(now_ns)
        return taken

    def _shed_overload(self, limit: int, now_ns: int) -> None:
        """Shed what this turn leaves behind, if turns have been behind for too long."""
        of_turn = self._backlog.of_a_turn(PER_TURN_OF_TAG)
        if self._cached:
            self._overload.end()
            self._of_single_tags.end()
        if of_turn > limit:
            waited_ns = now_ns - self._backlog.oldest_ns(PER_TURN_OF_TAG)
            if self._overload.judge(now_ns, waited_ns, len(self._backlog)):
                self._keep_newest(self._overload, now_ns, 0)
        elif of_turn < len(self._backlog):
            self._overload.caught_up(now_ns)
            waited_ns = now_ns - self._backlog.oldest_ns(0)
            if self._of_single_tags.judge(now_ns, waited_ns, len(self._backlog)):
                self._keep_newest(self._of_single_tags, now_ns, PER_TURN_OF_TAG)

    def _keep_newest(self, overload: Overload, now_ns: int, share: int) -> None:
        """Keep the newest message of every tag, and as many more as fit into half of `max_wait_ns`. Shed the others.

        share: tags with no more messages keep all.
        """
        rows, sizes = self._backlog.columns()
        kept = _newest(rows, sizes, overload.bytes_per_ns * self._max_wait_ns / 2)
        kept |= np.bincount(rows)[rows] <= share
        if not kept.all():
            self._shed_oldest(rows[~kept])
            overload.note_shed(now_ns)

    def _make_room(self, target_bytes: float) -> None:
        self._backlog.add(self._messages)
        self._messages = []
        rows, sizes = self._backlog.columns()
        kept = _newest(rows, sizes, target_bytes)
        by_age = np.argsort(self._backlog.arrivals(), kind="stable")[::-1]
        fits = np.empty(len(rows), bool)
        fits[by_age] = np.cumsum(np.where(kept, sizes, 0)[by_age]) <= target_bytes
        self._shed_oldest(rows[~(kept & fits)])

    def _shed_oldest(self, rows: Array) -> None:
        """Shed the oldest message of a tag for each time that its row is in `rows`."""
        lost = self._backlog.drop(rows)
        self._cached = max(0, self._cached - len(lost))
        self._bytes -= _size_of_all(lost)
        self._shed.update(map(ROW, lost))
        self._shed_samples += _samples_of(lost)


def _is_fair(messages: list[Message]) -> bool:
    """Return whether none of these messages is beyond its tag's share of a turn."""
    return len(messages) <= PER_TURN_OF_TAG or most_of_a_row(messages) <= PER_TURN_OF_TAG


def _size(message: Message | UnregisteredMessage) -> int:
    return len(message[1]) + MESSAGE_OVERHEAD


def _size_of_all(messages: list[Message]) -> int:
    return sum(map(len, map(PAYLOAD, messages))) + MESSAGE_OVERHEAD * len(messages)


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
