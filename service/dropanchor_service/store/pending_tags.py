"""Tags that have sent something but have no row yet. Their messages are buffered until they get one."""

from collections import OrderedDict
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

BufferedMessage = tuple[bytes, str, int]
"""Payload, encoding, UTC of arrival in ns."""

CONFIRMED_MESSAGES = 2  # messages that can be decoded
CONFIRMED_NS = 100_000_000  # from the first message to the last: a copy made on the way confirms nothing
MAX_BYTES = 16 * 2**20  # of all buffered messages
_OVERHEAD = 200  # bytes of a buffered message beside its payload


def is_confirmed(messages: Any, first_ns: Any, last_ns: Any) -> Any:
    """Return whether a tag keeps sending, from its message count and times. Takes one tag or columns of many."""
    return (messages >= CONFIRMED_MESSAGES) & (last_ns - first_ns >= CONFIRMED_NS)


@dataclass(slots=True)
class PendingTag:
    """A tag without a row. `messages` counts all that arrived; `buffered` holds those that were kept."""

    name: str
    first_heard_ns: int
    last_heard_ns: int
    messages: int = 0
    buffered: list[BufferedMessage] = field(default_factory=list)


class PendingTags:
    """Holds up to `limit` tags and `max_bytes` of messages, and evicts the least recent tag. Thread-safe."""

    def __init__(self, limit: int, max_bytes: int = MAX_BYTES) -> None:
        self._limit = limit
        self._max_bytes = max_bytes
        self._lock = Lock()
        self._by_name: OrderedDict[str, PendingTag] = OrderedDict()  # the least recent first
        self._bytes = 0
        self._evicted_messages = 0

    def __len__(self) -> int:
        return len(self._by_name)

    def on_message(self, name: str, arrival_ns: int) -> bool:
        """Count a message of this tag. Return whether its messages so far confirm the tag."""
        with self._lock:
            pending = self._by_name.pop(name, None) or PendingTag(name, arrival_ns, arrival_ns)
            self._by_name[name] = pending
            pending.messages += 1
            pending.last_heard_ns = arrival_ns
            if len(self._by_name) > self._limit:
                self._evicted_messages += len(self._remove(next(iter(self._by_name))))
            return bool(is_confirmed(pending.messages, pending.first_heard_ns, pending.last_heard_ns))

    def buffer(self, name: str, message: BufferedMessage) -> bool:
        """Keep a message of a pending tag. Return False when the tag is not pending or there is no room."""
        with self._lock:
            size = _size(message)
            if name not in self._by_name or self._bytes + size > self._max_bytes:
                return False
            self._by_name[name].buffered.append(message)
            self._bytes += size
            return True

    def take(self, name: str) -> list[BufferedMessage]:
        """Remove a tag that gets a row now. Return its buffered messages in order of arrival."""
        with self._lock:
            return self._remove(name) if name in self._by_name else []

    def take_evicted(self) -> int:
        """Return how many buffered messages were evicted with their tags since the last call."""
        with self._lock:
            evicted, self._evicted_messages = self._evicted_messages, 0
            return evicted

    def all(self) -> list[PendingTag]:
        """Return all pending tags, the most recent first."""
        with self._lock:
            return list(reversed(self._by_name.values()))

    def _remove(self, name: str) -> list[BufferedMessage]:
        buffered = self._by_name.pop(name).buffered
        self._bytes -= sum(map(_size, buffered))
        return buffered


def _size(message: BufferedMessage) -> int:
    return len(message[0]) + _OVERHEAD
