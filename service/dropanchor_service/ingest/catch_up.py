"""Put what tags published while nobody listened, fetched from their caches, before what is live.

The first messages of a tag are suspended until its caches have answered; then all go on in one order. No I/O: the
caller says what is live, what was fetched, and when an answer is complete.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from threading import Lock
from typing import NamedTuple

from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Frame, Rejection, read_header
from dropanchor_service.ingest.buffer import MESSAGE_OVERHEAD, MessageBuffer
from dropanchor_service.ingest.publishers import SequenceState

MOST_BYTES = 64 * 2**20  # of suspended messages; beyond it they go on as they are
TRIES = 10  # of asking again

StatesOf = Callable[[str], Mapping[int, SequenceState]]
"""What was fused before the restart of the tag with this key, by boot id."""


class _Number(NamedTuple):
    """t_ns: of a sample, on the publisher's own clock."""

    boot_id: int
    sequence: int
    t_ns: int


class _Suspended(NamedTuple):
    key: str
    payload: bytes
    encoding: str
    arrival_ns: int
    number: _Number | None


class CatchUp:
    """Between the session and the buffer. Its methods may be called from any thread; none of them waits.

    expected: keys of tags that the last process knew or an operator has listed. ask: called for each of them that is
    heard after the first round, and again where an answer lacks something, with the number of messages that are
    missing, 0 when it is not known, and how often it was asked for them before; `answered` is to be called when all
    that was asked for is `fetched`. most_of_new: so many are asked for of a publisher that the last process did not
    know.
    """

    def __init__(
        self,
        buffer: MessageBuffer,
        expected: Iterable[str],
        states_of: StatesOf,
        ask: Callable[[str, int, int], None],
        most_of_new: int,
    ) -> None:
        self._lock = Lock()
        self._buffer = buffer
        self._expected = set(expected)
        self._states_of = states_of
        self._ask = ask
        self._most_of_new = most_of_new
        self._first_round = True  # all caches are being asked, all messages are suspended
        self._suspended: dict[str, list[_Suspended]] = {}
        self._fetched: Counter[str] = Counter()  # since the key was asked last
        self._tries: Counter[str] = Counter()  # of asking again
        self._bytes = 0

    def hear(self, key: str, payload: bytes, encoding: str, arrival_ns: int) -> None:
        """A live message."""
        if self._waits(key):
            suspended = _Suspended(key, payload, encoding, arrival_ns, _number_of(payload, encoding))
            with self._lock:
                waits = self._waits(key) and not self._is_first(suspended)
                if waits:
                    self._suspend(suspended)
            if waits:
                self._bound()
                return
        self._buffer.append(key, payload, encoding, arrival_ns)

    def appear(self, key: str) -> None:
        """The tag is there, though it may have nothing to say any more."""
        with self._lock:
            if key in self._expected:
                self._open(key)

    def fetch(self, key: str, payload: bytes, encoding: str, arrival_ns: int) -> None:
        """A message from a cache."""
        suspended = _Suspended(key, payload, encoding, arrival_ns, _number_of(payload, encoding))
        with self._lock:
            if self._first_round or key in self._suspended:
                self._fetched[key] += 1
                self._suspend(suspended)
        self._bound()

    def answered(self, key: str, most: int) -> int:
        """The caches of this tag have told all, or their newest `most`. Returns how many messages go on."""
        with self._lock:
            if self._lacks(key, most):
                self._ask_again(key)
                return 0
        return self._release(key)

    def first_round_answered(self, most: int) -> int:
        """All caches that could be reached have told all, or their newest `most`. Tags that were heard without one are
        asked once more: a session that has just been opened tells of its caches last."""
        with self._lock:
            self._first_round = False
            unheard = {key for key in self._suspended if key in self._expected and not self._fetched[key]}
            again = unheard | {key for key in self._suspended if self._lacks(key, most)}
            for key in again:
                self._ask_again(key)
            complete = self._suspended.keys() - again
        return self._release(*complete)

    def _waits(self, key: str) -> bool:
        return self._first_round or key in self._expected or key in self._suspended

    def _is_first(self, message: _Suspended) -> bool:
        """Whether a tag that is new begins with it, so that there is nothing to ask its caches for."""
        number, key = message.number, message.key
        if self._first_round or key in self._suspended or number is None or number.sequence or self._states_of(key):
            return False
        self._expected.discard(key)
        return True

    def _lacks(self, key: str, most: int) -> bool:
        """Whether the answer is worth another question: it was cut short, nothing came although something is missing,
        or there is a hole in it. A publisher that learns of our subscription while it publishes may send a message
        neither to us nor to its cache in time."""
        if self._tries[key] >= TRIES:
            return False
        distances = self._distances(key)
        missing = self._missing(key)
        cut_short, silent = self._fetched[key] >= most, not self._fetched[key]
        return (missing > most and cut_short) or any(
            max(numbers) - min(numbers) >= len(numbers) or (silent and known and min(numbers) > 0)
            for known, numbers in distances
        )

    def _distances(self, key: str) -> list[tuple[bool, set[int]]]:
        """For each publisher, whether the last process knew it, and the numbers that were not fused, counted from the
        one that it expected, or from any."""
        passed, found = self._states_of(key), dict[int, set[int]]()
        first: dict[int, SequenceState] = {}
        for message in self._suspended.get(key, ()):
            if message.number:
                boot_id, sequence, _ = message.number
                origin = passed.get(boot_id) or first.setdefault(boot_id, SequenceState(sequence, 0))
                ahead = origin.ahead(sequence)
                if ahead >= 0 or boot_id in first:
                    found.setdefault(boot_id, set()).add(ahead)
        return [(boot_id in passed, numbers) for boot_id, numbers in found.items()]

    def _missing(self, key: str) -> int:
        """How many messages one of its publishers has sent that were not fused, as far as their numbers tell."""
        passed = self._states_of(key)
        numbers = [suspended.number for suspended in self._suspended.get(key, ()) if suspended.number]
        return max((self._missing_to(number, passed) for number in numbers), default=0)

    def _missing_to(self, number: _Number, passed: Mapping[int, SequenceState]) -> int:
        known = passed.get(number.boot_id)
        return max(0, known.ahead(number.sequence)) + 1 if known else min(number.sequence + 1, self._most_of_new)

    def _ask_again(self, key: str) -> None:
        self._ask(key, self._missing(key), self._tries[key])
        self._fetched[key] = 0
        self._tries[key] += 1

    def _suspend(self, message: _Suspended) -> None:
        self._open(message.key)
        self._suspended[message.key].append(message)
        self._bytes += _size(message)

    def _bound(self) -> None:
        if self._bytes > MOST_BYTES:
            self._release(*list(self._suspended))

    def _open(self, key: str) -> None:
        if key not in self._suspended:
            self._suspended[key] = []
            if not self._first_round:
                self._ask(key, 0, 0)

    def _release(self, *keys: str) -> int:
        """In the order in which they would have arrived: one message of a tag is fused at a time, but of many tags at
        once. Nobody who hears something waits for the sorting; what is heard meanwhile follows."""
        with self._lock:
            taken = {key: self._suspended[key] for key in keys if key in self._suspended}
            cached = any(self._fetched[key] or self._tries[key] for key in taken)
            self._suspended |= {key: [] for key in taken}
        released = [
            message for key, suspended in taken.items() for message in _in_order(suspended, self._states_of(key))
        ]
        released.sort(key=lambda message: message.arrival_ns)
        for message in released:
            self._buffer.append(message.key, message.payload, message.encoding, message.arrival_ns, cached)
        gone = {(message.key, message.number) for message in released if message.number}
        with self._lock:
            for key, suspended in taken.items():
                self._expected.discard(key)
                self._fetched.pop(key, None)
                self._tries.pop(key, None)
                meanwhile = self._suspended[key]
                self._bytes -= sum(map(_size, suspended)) + sum(map(_size, meanwhile))
                for message in meanwhile:
                    if (key, message.number) not in gone:
                        self._buffer.append(key, message.payload, message.encoding, message.arrival_ns)
                del self._suspended[key]  # from now on what is heard does not wait for the lock
        return len(released)


def _size(message: _Suspended) -> int:
    return len(message.payload) + MESSAGE_OVERHEAD


_Numbered = tuple[_Number, _Suspended]


def _in_order(suspended: list[_Suspended], passed: Mapping[int, SequenceState]) -> list[_Suspended]:
    """Every message once, as they would have arrived: each publisher's in the order of their numbers, with the delay
    that its newest one has."""
    by_publisher: dict[int, dict[int, _Numbered]] = {}
    others: list[_Suspended] = []
    for message in suspended:
        number = message.number
        if number is None:
            others.append(message)
            continue
        known = passed.get(number.boot_id)
        if known is None or not known.has(number.sequence):
            by_publisher.setdefault(number.boot_id, {}).setdefault(number.sequence, (number, message))
    for messages in by_publisher.values():
        others += _as_if_live(list(messages.values()))
    return others


def _as_if_live(messages: list[_Numbered]) -> Iterator[_Suspended]:
    """One publisher's, with the arrivals that they would have had; clocks that jump move none behind the next one."""
    first = messages[0][0].sequence
    ordered = sorted(messages, key=lambda entry: (entry[0].sequence - first + 2**31) % 2**32)
    newest, last = ordered[-1]
    delay_ns, arrival_ns = last.arrival_ns - newest.t_ns, last.arrival_ns
    arrivals: list[int] = []
    for number, _ in reversed(ordered):
        arrival_ns = min(arrival_ns, number.t_ns + delay_ns)
        arrivals.append(arrival_ns)
    for (number, suspended), arrived_ns in zip(ordered, reversed(arrivals), strict=True):
        yield _Suspended(suspended.key, suspended.payload, suspended.encoding, arrived_ns, number)


def _number_of(payload: bytes, encoding: str) -> _Number | None:
    """None where it is not numbered."""
    kind = encoding.partition(";")[0]
    if kind == ENCODING_PACKED:
        header = read_header(payload)
        if isinstance(header, Rejection):
            return None
        _, _, sequence, boot_id, t_ns = header
        return _Number(boot_id, sequence, t_ns) if boot_id else None
    frame = decode_json(payload) if kind == ENCODING_JSON else None
    if not isinstance(frame, Frame) or frame.sequence is None or not frame.boot_id:
        return None
    columns = (frame.imu, frame.ranges, frame.headings, frame.bearings)
    return _Number(frame.boot_id, frame.sequence, min(sample.t_ns for column in columns for sample in column))
