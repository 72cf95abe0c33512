"""Put messages from the tags' caches, which were published while the service was away or got lost, before live ones.

The first live messages of a tag, and those behind a gap, are suspended until its caches have answered. Then all of its
messages go to the buffer in one order. This module does no I/O: the caller passes live and cached messages, and says
when an answer is complete.
"""

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from threading import Lock

from dropanchor_service.ingest.backlog import Message
from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.gaps import Gaps
from dropanchor_service.ingest.released import Released
from dropanchor_service.ingest.sequence_states import StatesOf
from dropanchor_service.ingest.suspended import Number, Suspended, distances, in_order, missing, number_of, size_of

MAX_BYTES = 64 * 2**20  # of suspended messages; beyond it all of them are released
MAX_RETRIES = 10
PATIENCE_S = 5.0  # that a cache which used to answer gets: its tag or its router may be connecting again


class CatchUp:
    """Stands between the Zenoh session and the buffer. Its methods are thread-safe, and none of them blocks for long.

    expected: keys of tags that the last process knew or an operator has listed. ask: called with the key of a tag, the
    number of missing messages (0: unknown) and the number of earlier retries. It is called when an expected tag first
    sends after the first round, when there is a gap, and again when an answer is incomplete. After passing all replies
    to `on_cached`, the caller calls `on_answer`. new_publisher_limit: number of messages to ask for from a publisher
    that the last process did not know. now_s: a clock that is never set.
    """

    def __init__(
        self,
        buffer: MessageBuffer,
        expected: Iterable[str],
        states_of: StatesOf,
        ask: Callable[[str, int, int], None],
        new_publisher_limit: int,
        now_s: Callable[[], float] = time.monotonic,
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
        self._answered: dict[str, set[int]] = {}  # boot ids of these messages
        self._retries: Counter[str] = Counter()
        self._now_s = now_s
        self._asked_s: dict[str, float] = {}  # when the caches of a suspended key were first asked
        self._gaps = Gaps()
        self._with_gap: set[str] = set()  # keys that are suspended because of a gap
        self._releasing: dict[str, set[Number | None]] = {}  # messages of a key that are on their way to the buffer
        self._released: defaultdict[str, Released] = defaultdict(Released)
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
            self._gaps.on_alive(key)
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

    def on_gap(self, key: str, messages: Iterable[Message]) -> bool:
        """Suspend messages that came before one with a smaller number, and ask the tag's caches for what is missing.

        Return whether they are suspended. They are not if the caches were asked for the same gap before, or are known
        not to answer, or in an overload, which answers would make worse.
        """
        suspended = [Suspended(key, *message[1:], number_of(message[1], message[2])) for message in messages]
        states = self._states_of(key)
        numbers = [message.number for message in suspended if message.number and message.number.boot_id in states]
        with self._lock:
            if self._first_round or self._buffer.is_overloaded:
                return False
            self._releasing.get(key, set()).difference_update(message.number for message in suspended)  # they came back
            self._released[key].forget_from(message.number for message in suspended if message.number)
            if key not in self._suspended:
                if not self._gaps.is_new(key, numbers):
                    return False
                self._with_gap.add(key)
                self._open(key, self._missing(key, numbers))
            for message in suspended:
                self._suspend(message)
        self._bound()
        return True

    def on_cached(self, key: str, payload: bytes, encoding: str, arrival_ns: int) -> None:
        """Suspend a message from a cache, if its tag is catching up."""
        suspended = Suspended(key, payload, encoding, arrival_ns, number_of(payload, encoding))
        with self._lock:
            if self._first_round or key in self._suspended:
                if suspended.number:
                    self._gaps.on_cached(key, suspended.number.boot_id)
                    self._answered.setdefault(key, set()).add(suspended.number.boot_id)
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
            if key in self._with_gap:
                for boot_id in self._unheard(key):
                    self._gaps.on_no_answer(key, boot_id)
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
        unheard = self._unheard(key)
        if not self._may_wait(key, unheard):
            return False
        missing = self._missing(key, self._suspended_numbers(key))
        cut_short, empty = self._cached[key] >= limit, not self._cached[key]
        return (
            (missing > limit and cut_short)
            or (empty and key in self._silent)
            or bool(unheard)
            or any(max(numbers) - min(numbers) >= len(numbers) for numbers in self._distances(key).values())
        )

    def _may_wait(self, key: str, unheard: set[int]) -> bool:
        """Return whether the caches may be asked again, if some of them have not answered.

        At its first gap nobody knows whether a tag has caches: its router may not have announced them again yet. One
        that has none waits in vain then, and never again until it announces itself anew.
        """
        may_retry = self._retries[key] < MAX_RETRIES
        if any(self._gaps.has_cache(key, boot_id) for boot_id in unheard):
            return may_retry or self._has_time(key)
        return may_retry and (not unheard or key not in self._with_gap or self._has_time(key))

    def _has_time(self, key: str) -> bool:
        return self._now_s() - self._asked_s[key] < PATIENCE_S

    def _unheard(self, key: str) -> set[int]:
        """Return the boot ids of known publishers with a missing message whose caches have not answered.

        If those of other publishers have answered, only caches are meant that used to answer.
        """
        answered, states = self._answered.get(key, set()), self._states_of(key)
        missing = {
            boot_id for boot_id, numbers in self._distances(key).items() if boot_id in states and min(numbers) > 0
        }
        return {
            boot_id
            for boot_id in missing - answered
            if not self._gaps.lacks_cache(key, boot_id)
            and (not self._cached[key] or key in self._with_gap or self._gaps.has_cache(key, boot_id))
        }

    def _distances(self, key: str) -> dict[int, set[int]]:
        return distances(self._suspended.get(key, ()), self._states_of(key))

    def _missing(self, key: str, numbers: Iterable[Number]) -> int:
        return missing(numbers, self._states_of(key), self._new_publisher_limit)

    def _suspended_numbers(self, key: str) -> list[Number]:
        return [message.number for message in self._suspended.get(key, ()) if message.number]

    def _ask_again(self, key: str) -> None:
        self._ask(key, self._missing(key, self._suspended_numbers(key)), self._retries[key])
        self._cached[key] = 0
        self._answered.pop(key, None)
        self._retries[key] += 1

    def _suspend(self, message: Suspended) -> None:
        self._open(message.key)
        self._suspended[message.key].append(message)
        self._bytes += size_of(message)

    def _bound(self) -> None:
        if self._bytes > MAX_BYTES:
            self._release(*list(self._suspended))

    def _open(self, key: str, missing: int = 0) -> None:
        if key not in self._suspended:
            self._suspended[key] = []
            self._asked_s[key] = self._now_s()
            if not self._first_round:
                self._ask(key, missing, 0)

    def _release(self, *keys: str) -> int:
        """Pass the suspended messages to the buffer in the order in which they would have arrived live.

        The order mixes the tags, because a batch holds one message of each tag. The lock is not held while sorting:
        messages that arrive meanwhile stay suspended and follow.
        """
        with self._lock:
            waiting = self._suspended.keys() - self._releasing.keys()
            taken = {key: self._suspended[key] for key in keys if key in waiting}
            # What fills gaps is little, and it must not hide an overload from the buffer.
            cached = any(self._cached[key] or self._retries[key] for key in taken.keys() - self._with_gap)
            self._suspended |= {key: [] for key in taken}
            self._releasing |= {key: set() for key in taken}
            new = {key: self._released[key].new(suspended, self._states_of(key)) for key, suspended in taken.items()}
        released = [message for key, suspended in new.items() for message in in_order(suspended, self._states_of(key))]
        released.sort(key=lambda message: message.arrival_ns)
        with self._lock:
            self._note_asked(released)
            for message in released:
                if message.number:
                    self._releasing[message.key].add(message.number)
                    self._released[message.key].add(message.number)
        for message in released:
            self._buffer.append(message.key, message.payload, message.encoding, message.arrival_ns, cached)
        with self._lock:
            for key, suspended in taken.items():
                self._end_release(key, suspended)
        return len(released)

    def _note_asked(self, released: Iterable[Suspended]) -> None:
        """Remember that the caches have nothing more of what was published before these messages."""
        newest = {(message.key, message.number.boot_id): message.number for message in released if message.number}
        for (key, boot_id), number in newest.items():
            if key in self._with_gap or boot_id in self._answered.get(key, ()):
                self._gaps.on_asked(key, number)

    def _end_release(self, key: str, released: list[Suspended]) -> None:
        """Let the messages that came meanwhile follow, and forget how the caches of the tag were asked."""
        meanwhile, released_numbers = self._suspended[key], self._releasing.pop(key)
        self._bytes -= sum(map(size_of, released)) + sum(map(size_of, meanwhile))
        for keys in (self._expected, self._silent, self._with_gap):
            keys.discard(key)
        for by_key in (self._cached, self._answered, self._retries, self._asked_s):
            by_key.pop(key, None)
        for message in meanwhile:
            if message.number not in released_numbers:
                self._buffer.append(key, message.payload, message.encoding, message.arrival_ns)
        del self._suspended[key]  # live messages now bypass the lock
