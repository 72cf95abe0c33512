"""What tags published while nobody listened, fetched from their publishers' caches and put before what is live.

The first messages of a tag are held until its caches have been asked; then all go on in one order. Pure: it is told
what is live, what was fetched, and when an answer is complete.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from threading import Lock
from typing import NamedTuple

from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Frame, Rejection, read_header
from dropanchor_service.buffer import MESSAGE_OVERHEAD, MessageBuffer

MOST_BYTES = 64 * 2**20  # of held messages; beyond it they go on as they are

IsRepeated = Callable[[str, int, int], bool]
"""Whether the message with this key, boot id and sequence was fused before the restart."""


class _Held(NamedTuple):
    key: str
    payload: bytes
    encoding: str
    arrival_ns: int


class CatchUp:
    """Between the session and the buffer. Its methods may be called from any thread; none of them waits.

    expected: keys of tags that the last process knew or an operator has listed. ask: called once for each of them that
    is heard after the first round; `answered` is to be called when all that its caches hold was `fetched`.
    """

    def __init__(
        self, buffer: MessageBuffer, expected: Iterable[str], is_repeated: IsRepeated, ask: Callable[[str], None]
    ) -> None:
        self._lock = Lock()
        self._buffer = buffer
        self._expected = set(expected)
        self._is_repeated = is_repeated
        self._ask = ask
        self._first_round = True  # all caches are being asked, all messages are held
        self._held: dict[str, list[_Held]] = {}
        self._fetched: Counter[str] = Counter()
        self._bytes = 0

    def hear(self, key: str, payload: bytes, encoding: str, arrival_ns: int) -> None:
        """A live message."""
        if self._first_round or key in self._expected:
            with self._lock:
                if self._first_round or key in self._expected:
                    self._hold(_Held(key, payload, encoding, arrival_ns))
                    return
        self._buffer.append(key, payload, encoding, arrival_ns)

    def appear(self, key: str) -> None:
        """The tag is there, though it may have nothing to say any more."""
        with self._lock:
            if key in self._expected:
                self._open(key)

    def fetch(self, key: str, payload: bytes, encoding: str, arrival_ns: int) -> None:
        """A message from a cache."""
        with self._lock:
            if self._first_round or key in self._held:
                self._fetched[key] += 1
                self._hold(_Held(key, payload, encoding, arrival_ns))

    def answered(self, key: str) -> int:
        """The caches of this tag have told all. Returns how many messages go on."""
        with self._lock:
            return self._release(key)

    def first_round_answered(self) -> int:
        """All caches that could be reached have told all. Tags that were heard without one are asked once more: a
        session that has just been opened tells of its caches last."""
        with self._lock:
            self._first_round = False
            released = 0
            for key in list(self._held):
                if key in self._expected and not self._fetched[key]:
                    self._ask(key)
                else:
                    released += self._release(key)
            return released

    def _hold(self, message: _Held) -> None:
        self._open(message.key)
        self._held[message.key].append(message)
        self._bytes += len(message.payload) + MESSAGE_OVERHEAD
        if self._bytes > MOST_BYTES:
            for key in list(self._held):
                self._release(key)

    def _open(self, key: str) -> None:
        if key not in self._held:
            self._held[key] = []
            if not self._first_round:
                self._ask(key)

    def _release(self, key: str) -> int:
        self._expected.discard(key)
        self._fetched.pop(key, None)
        held = self._held.pop(key, [])
        self._bytes -= sum(len(message.payload) + MESSAGE_OVERHEAD for message in held)
        ordered = _in_order(held, self._is_repeated)
        for message in ordered:
            self._buffer.append(*message)
        return len(ordered)


class _Numbered(NamedTuple):
    message: _Held
    sequence: int
    t_ns: int


def _in_order(held: list[_Held], is_repeated: IsRepeated) -> list[_Held]:
    """Every message once, as they would have arrived: each publisher's in the order of their numbers, with the delay
    that its newest one has."""
    by_publisher: dict[int, dict[int, _Numbered]] = {}
    others: list[_Held] = []
    for message in held:
        number = _number_of(message)
        if number is None:
            others.append(message)
            continue
        boot_id, sequence, t_ns = number
        if not is_repeated(message.key, boot_id, sequence):
            by_publisher.setdefault(boot_id, {}).setdefault(sequence, _Numbered(message, sequence, t_ns))
    for messages in by_publisher.values():
        others += _as_if_live(list(messages.values()))
    return sorted(others, key=lambda message: message.arrival_ns)


def _as_if_live(messages: list[_Numbered]) -> list[_Held]:
    """One publisher's, with the arrivals that they would have had; clocks that jump move none behind the next one."""
    first = messages[0].sequence
    ordered = sorted(messages, key=lambda entry: (entry.sequence - first + 2**31) % 2**32)
    newest = ordered[-1]
    delay_ns = newest.message.arrival_ns - newest.t_ns
    arrival_ns = newest.message.arrival_ns
    live: list[_Held] = []
    for message, _, t_ns in reversed(ordered):
        arrival_ns = min(arrival_ns, t_ns + delay_ns)
        live.append(message._replace(arrival_ns=arrival_ns))
    return live[::-1]


def _number_of(message: _Held) -> tuple[int, int, int] | None:
    """Boot id, sequence and the time of a sample on the publisher's own clock; None where it is not numbered."""
    kind = message.encoding.partition(";")[0]
    if kind == ENCODING_PACKED:
        header = read_header(message.payload)
        if isinstance(header, Rejection):
            return None
        _, _, sequence, boot_id, t_ns = header
        return (boot_id, sequence, t_ns) if boot_id else None
    frame = decode_json(message.payload) if kind == ENCODING_JSON else None
    if not isinstance(frame, Frame) or frame.sequence is None or not frame.boot_id:
        return None
    columns = (frame.imu, frame.ranges, frame.headings, frame.bearings)
    return frame.boot_id, frame.sequence, min(sample.t_ns for column in columns for sample in column)
