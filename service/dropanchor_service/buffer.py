"""Messages between the threads that receive them and the one that fuses them."""

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from threading import Event, Lock

Received = tuple[str, bytes, str, int]
"""Key, payload, encoding, UTC of arrival in ns."""

MESSAGE_OVERHEAD = 200  # bytes that a waiting message takes beside its payload
STRANGERS = 1024  # messages of tags without a row that may wait
_KEPT_SHARE = 0.75  # of the capacity after shedding, so that shedding is rare


class MessageBuffer:
    """Bounded. When it is full, the keys that fill it most lose their oldest messages.

    Keys that are not known wait apart, where only they push out each other: a flood of them harms no known tag.
    """

    def __init__(self, capacity_bytes: int) -> None:
        self._capacity_bytes = capacity_bytes
        self._lock = Lock()
        self._filled = Event()
        self._known: set[str] = set()
        self._messages: list[Received] = []
        self._bytes = 0
        self._strangers: deque[Received] = deque(maxlen=STRANGERS)
        self._shed: Counter[str] = Counter()
        self._strangers_shed = 0

    def append(self, key: str, payload: bytes, encoding: str, arrival_ns: int) -> None:
        """From any thread; blocks for no longer than shedding takes."""
        with self._lock:
            if key in self._known:
                self._messages.append((key, payload, encoding, arrival_ns))
                self._bytes += len(payload) + MESSAGE_OVERHEAD
                if self._bytes > self._capacity_bytes:
                    self._make_room()
            else:
                self._strangers_shed += len(self._strangers) == STRANGERS
                self._strangers.append((key, payload, encoding, arrival_ns))
        if not self._filled.is_set():
            self._filled.set()

    def admit(self, keys: Iterable[str]) -> None:
        """These keys are known from now on."""
        with self._lock:
            self._known.update(keys)

    def wait(self, timeout_s: float) -> bool:
        """Until there is a message; False when there is none in time."""
        return self._filled.wait(timeout_s)

    def drain(self, most: int) -> Sequence[Received]:
        """The oldest messages, at most so many of known keys, then those of strangers."""
        with self._lock:
            taken = self._messages[:most]
            del self._messages[:most]
            self._bytes -= sum(len(message[1]) + MESSAGE_OVERHEAD for message in taken)
            taken.extend(self._strangers)
            self._strangers.clear()
            if not self._messages:
                self._filled.clear()
            return taken

    def take_shed(self) -> tuple[Counter[str], int]:
        """Messages lost since the last call: by key, and of strangers."""
        with self._lock:
            shed = self._shed, self._strangers_shed
            self._shed, self._strangers_shed = Counter(), 0
            return shed

    @property
    def depth(self) -> int:
        return len(self._messages) + len(self._strangers)

    def _make_room(self) -> None:
        cap = _fair_cap(_bytes_by_key(self._messages), int(_KEPT_SHARE * self._capacity_bytes))
        kept: list[Received] = []
        used: Counter[str] = Counter()
        for message in reversed(self._messages):
            key = message[0]
            used[key] += len(message[1]) + MESSAGE_OVERHEAD
            if used[key] <= cap:
                kept.append(message)
            else:
                self._shed[key] += 1
        kept.reverse()
        self._messages = kept
        self._bytes = sum(_bytes_by_key(kept).values())


def _bytes_by_key(messages: Sequence[Received]) -> Counter[str]:
    sizes: Counter[str] = Counter()
    for key, payload, _, _ in messages:
        sizes[key] += len(payload) + MESSAGE_OVERHEAD
    return sizes


def _fair_cap(sizes: Counter[str], target: int) -> int:
    """The largest share c with sum(min(size, c)) <= target."""
    left = target
    ascending = sorted(sizes.values())
    for index, size in enumerate(ascending):
        share = left // (len(ascending) - index)
        if size > share:
            return share
        left -= size
    return target
