"""Put messages from the tags' caches, which were published while the service was away, before live ones.

The first live messages of a tag are suspended until its caches have answered. Then all of its messages go to the buffer
in one order. This module does no I/O: the caller passes live and cached messages, and says when an answer is complete.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from threading import Lock

from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.publishers import Publishers, SequenceState
from dropanchor_service.ingest.suspended import Number, Suspended, in_order, number_of, size_of
from dropanchor_service.store import Sites

MAX_BYTES = 64 * 2**20  # of suspended messages; beyond it all of them are released
MAX_RETRIES = 10

StatesOf = Callable[[str], Mapping[int, SequenceState]]
"""Return what was fused before the restart, by boot id, for the tag with this key."""


class CatchUp:
    """Stands between the Zenoh session and the buffer. Its methods are thread-safe, and none of them blocks for long.

    expected: keys of tags that the last process knew or an operator has listed. ask: called with the key of a tag, the
    number of missing messages (0: unknown) and the number of earlier retries. It is called when an expected tag first
    sends after the first round, and again when an answer is incomplete. After passing all replies to `on_cached`, the
    caller calls `on_answer`. new_publisher_limit: number of messages to ask for from a publisher that the last process
    did not know.
    """

    def __init__(
        self,
        buffer: MessageBuffer,
        expected: Iterable[str],
        states_of: StatesOf,
        ask: Callable[[str, int, int], None],
        new_publisher_limit: int,
    ) -> None:
        self._lock = Lock()
        self._buffer = buffer
        self._expected = set(expected)
        self._states_of = states_of
        self._ask = ask
        self._new_publisher_limit = new_publisher_limit
        self._first_round = True  # all caches are being asked, and all messages are suspended
        self._suspended: dict[str, list[Suspended]] = {}
        self._cached: Counter[str] = Counter()  # cached messages since the caches of a key were last asked
        self._retries: Counter[str] = Counter()
        self._silent: set[str] = set()  # keys whose caches exist, so that an empty answer is none
        self._bytes = 0

    def on_live(self, key: str, payload: bytes, encoding: str, arrival_ns: int) -> None:
        """Suspend a live message while its tag is catching up, or pass it to the buffer."""
        if self._suspends(key):
            suspended = Suspended(key, payload, encoding, arrival_ns, number_of(payload, encoding))
            with self._lock:
                suspends = self._suspends(key) and not self._is_first(suspended)
                if suspends:
                    self._suspend(suspended)
            if suspends:
                self._bound()
                return
        self._buffer.append(key, payload, encoding, arrival_ns)

    def on_alive(self, key: str) -> None:
        """Ask the caches of an expected tag that is online, though it may not send anything new."""
        with self._lock:
            if key in self._expected:
                self._open(key)

    def on_silent(self, key: str) -> None:
        """Ask the caches of a tag that is online again but sends nothing new."""
        with self._lock:
            self._silent.add(key)
            self._open(key)

    def on_newest(self, key: str, payload: bytes, encoding: str) -> None:
        """Ask the caches of a tag that has fallen silent, unless this newest message of a publisher was fused."""
        number = number_of(payload, encoding)
        known = self._states_of(key).get(number.boot_id) if number else None
        if number is not None and known is not None and not known.has(number.sequence):
            self.on_silent(key)

    def on_cached(self, key: str, payload: bytes, encoding: str, arrival_ns: int) -> None:
        """Suspend a message from a cache, if its tag is catching up."""
        suspended = Suspended(key, payload, encoding, arrival_ns, number_of(payload, encoding))
        with self._lock:
            if self._first_round or key in self._suspended:
                self._cached[key] += 1
                self._suspend(suspended)
        self._bound()

    def on_answer(self, key: str, limit: int) -> int:
        """Release the messages of a tag whose caches have answered, or ask again if something is missing.

        limit: number of messages that each cache was asked for. Returns the number of released messages.
        """
        with self._lock:
            if self._is_incomplete(key, limit):
                self._ask_again(key)
                return 0
        return self._release(key)

    def on_first_round_answer(self, limit: int) -> int:
        """Release the messages of all tags when every cache in reach has answered, and ask incomplete ones again.

        A tag that sends live messages but whose caches did not answer is asked again too: a session that was just
        opened announces its caches last. limit: number of messages that each cache was asked for. Returns the number
        of released messages.
        """
        with self._lock:
            self._first_round = False
            unanswered = {key for key in self._suspended if key in self._expected and not self._cached[key]}
            again = unanswered | {key for key in self._suspended if self._is_incomplete(key, limit)}
            for key in again:
                self._ask_again(key)
            complete = self._suspended.keys() - again
        return self._release(*complete)

    def _suspends(self, key: str) -> bool:
        return self._first_round or key in self._expected or key in self._suspended

    def _is_first(self, message: Suspended) -> bool:
        """Return whether this is the first message of a new tag, so that its caches hold nothing else."""
        number, key = message.number, message.key
        if self._first_round or key in self._suspended or number is None or number.sequence or self._states_of(key):
            return False
        self._expected.discard(key)
        return True

    def _is_incomplete(self, key: str, limit: int) -> bool:
        """Return whether to ask again: the answer was cut short, was empty although messages are missing, or has a gap.

        A publisher that learns of our subscription while it publishes may send a message neither to us nor, in time, to
        its cache.
        """
        if self._retries[key] >= MAX_RETRIES:
            return False
        distances = self._distances(key)
        missing = self._missing(key)
        cut_short, empty = self._cached[key] >= limit, not self._cached[key]
        return (
            (missing > limit and cut_short)
            or (empty and key in self._silent)
            or any(
                max(numbers) - min(numbers) >= len(numbers) or (empty and known and min(numbers) > 0)
                for known, numbers in distances
            )
        )

    def _distances(self, key: str) -> list[tuple[bool, set[int]]]:
        """Return for each publisher whether the last process knew it, and the numbers of its messages to fuse.

        The numbers are relative to the expected one or, for a new publisher, to its first suspended one.
        """
        states, found = self._states_of(key), dict[int, set[int]]()
        first: dict[int, SequenceState] = {}
        for message in self._suspended.get(key, ()):
            if message.number:
                boot_id, sequence, _ = message.number
                origin = states.get(boot_id) or first.setdefault(boot_id, SequenceState(sequence, 0))
                ahead = origin.ahead(sequence)
                if ahead >= 0 or boot_id in first:
                    found.setdefault(boot_id, set()).add(ahead)
        return [(boot_id in states, numbers) for boot_id, numbers in found.items()]

    def _missing(self, key: str) -> int:
        """Return the largest number of messages that one of the tag's publishers has sent and that were not fused."""
        states = self._states_of(key)
        numbers = [suspended.number for suspended in self._suspended.get(key, ()) if suspended.number]
        return max((self._missing_to(number, states) for number in numbers), default=0)

    def _missing_to(self, number: Number, states: Mapping[int, SequenceState]) -> int:
        known = states.get(number.boot_id)
        return (
            max(0, known.ahead(number.sequence)) + 1 if known else min(number.sequence + 1, self._new_publisher_limit)
        )

    def _ask_again(self, key: str) -> None:
        self._ask(key, self._missing(key), self._retries[key])
        self._cached[key] = 0
        self._retries[key] += 1

    def _suspend(self, message: Suspended) -> None:
        self._open(message.key)
        self._suspended[message.key].append(message)
        self._bytes += size_of(message)

    def _bound(self) -> None:
        if self._bytes > MAX_BYTES:
            self._release(*list(self._suspended))

    def _open(self, key: str) -> None:
        if key not in self._suspended:
            self._suspended[key] = []
            if not self._first_round:
                self._ask(key, 0, 0)

    def _release(self, *keys: str) -> int:
        """Pass the suspended messages to the buffer in the order in which they would have arrived live.

        The order mixes the tags, because a batch holds one message of each tag. The lock is not held while sorting:
        messages that arrive meanwhile stay suspended and follow.
        """
        with self._lock:
            taken = {key: self._suspended[key] for key in keys if key in self._suspended}
            cached = any(self._cached[key] or self._retries[key] for key in taken)
            self._suspended |= {key: [] for key in taken}
        released = [
            message for key, suspended in taken.items() for message in in_order(suspended, self._states_of(key))
        ]
        released.sort(key=lambda message: message.arrival_ns)
        for message in released:
            self._buffer.append(message.key, message.payload, message.encoding, message.arrival_ns, cached)
        released_numbers = {(message.key, message.number) for message in released if message.number}
        with self._lock:
            for key, suspended in taken.items():
                self._expected.discard(key)
                self._cached.pop(key, None)
                self._retries.pop(key, None)
                self._silent.discard(key)
                meanwhile = self._suspended[key]
                self._bytes -= sum(map(size_of, suspended)) + sum(map(size_of, meanwhile))
                for message in meanwhile:
                    if (key, message.number) not in released_numbers:
                        self._buffer.append(key, message.payload, message.encoding, message.arrival_ns)
                del self._suspended[key]  # live messages now bypass the lock
        return len(released)


def sequence_states(sites: Sites, publishers: Publishers) -> StatesOf:
    """Return a function that looks up the publishers of a tag by the tag's key."""

    def states_of(key: str) -> Mapping[int, SequenceState]:
        tag = sites.tag_of(key)
        return {} if tag is None else publishers.sequence_states(tag.row)

    return states_of
