"""Tags that have been heard and have no row: their names, and messages that wait until they get one."""

from collections import OrderedDict
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

Waiting = tuple[bytes, str, int]
"""Payload, encoding, UTC of arrival in ns."""

CONFIRMED_MESSAGES = 2  # that can be decoded
CONFIRMED_NS = 100_000_000  # from the first of them to the last: a message that was doubled on its way proves nothing
MOST_BYTES = 16 * 2**20  # of all messages that wait
_OVERHEAD = 200  # bytes of one beside its payload


def is_confirmed(messages: Any, first_ns: Any, last_ns: Any) -> Any:
    """Whether somebody is there who goes on sending; for one tag or for columns of many."""
    return (messages >= CONFIRMED_MESSAGES) & (last_ns - first_ns >= CONFIRMED_NS)


@dataclass(slots=True)
class PendingTag:
    """messages: how many have come, of which those in `waiting` are kept."""

    name: str
    first_heard_ns: int
    last_heard_ns: int
    messages: int = 0
    waiting: list[Waiting] = field(default_factory=list)


class PendingTags:
    """At most so many, and MOST_BYTES of messages: who was heard least recently gives way. From any thread."""

    def __init__(self, most: int, most_bytes: int = MOST_BYTES) -> None:
        self._most = most
        self._most_bytes = most_bytes
        self._lock = Lock()
        self._by_name: OrderedDict[str, PendingTag] = OrderedDict()  # who was heard least recently first
        self._bytes = 0
        self._gone = 0

    def __len__(self) -> int:
        return len(self._by_name)

    def hear(self, name: str, arrival_ns: int) -> bool:
        """A message has come. Returns whether those that came so far are a confirmed."""
        with self._lock:
            pending = self._by_name.pop(name, None) or PendingTag(name, arrival_ns, arrival_ns)
            self._by_name[name] = pending
            pending.messages += 1
            pending.last_heard_ns = arrival_ns
            if len(self._by_name) > self._most:
                self._gone += len(self._forget(next(iter(self._by_name))))
            return bool(is_confirmed(pending.messages, pending.first_heard_ns, pending.last_heard_ns))

    def keep(self, name: str, message: Waiting) -> bool:
        """Let the message of somebody who was just heard wait; False when there is no room for it."""
        with self._lock:
            size = _size(message)
            if name not in self._by_name or self._bytes + size > self._most_bytes:
                return False
            self._by_name[name].waiting.append(message)
            self._bytes += size
            return True

    def take(self, name: str) -> list[Waiting]:
        """The messages that waited, of a tag that has a row from now on, in order of arrival."""
        with self._lock:
            return self._forget(name) if name in self._by_name else []

    def take_gone(self) -> int:
        """Messages that waited in vain since the last call."""
        with self._lock:
            gone, self._gone = self._gone, 0
            return gone

    def all(self) -> list[PendingTag]:
        """Who was heard last first."""
        with self._lock:
            return list(reversed(self._by_name.values()))

    def _forget(self, name: str) -> list[Waiting]:
        waiting = self._by_name.pop(name).waiting
        self._bytes -= sum(map(_size, waiting))
        return waiting


def _size(message: Waiting) -> int:
    return len(message[0]) + _OVERHEAD
