"""Messages that wait for the answers of caches: their numbers and sizes, what is missing, and the order of release."""

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Frame, Rejection, read_header
from dropanchor_service.ingest.backlog import MESSAGE_OVERHEAD
from dropanchor_service.ingest.publishers import SequenceState


class Number(NamedTuple):
    """t_ns: time of a sample, on the publisher's own clock."""

    boot_id: int
    sequence: int
    t_ns: int


class Suspended(NamedTuple):
    key: str
    payload: bytes
    encoding: str
    arrival_ns: int
    number: Number | None


def size_of(message: Suspended) -> int:
    return len(message.payload) + MESSAGE_OVERHEAD


def distances(suspended: Iterable[Suspended], states: Mapping[int, SequenceState]) -> dict[int, set[int]]:
    """Return the numbers of the messages to fuse, by the boot id of their publisher.

    They are relative to the expected one or, for a new publisher, to its first suspended one.
    """
    found: dict[int, set[int]] = {}
    first: dict[int, SequenceState] = {}
    for message in suspended:
        if message.number:
            boot_id, sequence, _ = message.number
            origin = states.get(boot_id) or first.setdefault(boot_id, SequenceState(sequence, 0))
            ahead = origin.ahead(sequence)
            if ahead >= 0 or boot_id in first:
                found.setdefault(boot_id, set()).add(ahead)
    return found


def missing(numbers: Iterable[Number], states: Mapping[int, SequenceState], new_publisher_limit: int) -> int:
    """Return the largest number of messages that one of the tag's publishers has sent and that were not fused.

    numbers: of suspended messages. new_publisher_limit: bounds the result for a publisher without a state.
    """

    def missing_to(number: Number) -> int:
        known = states.get(number.boot_id)
        return max(0, known.ahead(number.sequence)) + 1 if known else min(number.sequence + 1, new_publisher_limit)

    return max(map(missing_to, numbers), default=0)


_Numbered = tuple[Number, Suspended]


def in_order(suspended: list[Suspended], states: Mapping[int, SequenceState]) -> list[Suspended]:
    """Return every message once, with the arrival that it would have had live.

    Those of each publisher are in the order of their numbers, and have the delay of its newest message.
    """
    by_publisher: dict[int, dict[int, _Numbered]] = {}
    others: list[Suspended] = []
    for message in suspended:
        number = message.number
        if number is None:
            others.append(message)
            continue
        known = states.get(number.boot_id)
        if known is None or not known.has(number.sequence):
            by_publisher.setdefault(number.boot_id, {}).setdefault(number.sequence, (number, message))
    for messages in by_publisher.values():
        others += _as_if_live(list(messages.values()))
    return others


def _as_if_live(messages: list[_Numbered]) -> Iterator[Suspended]:
    """Yield the messages of one publisher with the arrivals that they would have had live.

    The arrivals are in the order of the numbers, even if a clock jumped.
    """
    first = messages[0][0].sequence
    ordered = sorted(messages, key=lambda entry: (entry[0].sequence - first + 2**31) % 2**32)
    newest, last = ordered[-1]
    delay_ns, arrival_ns = last.arrival_ns - newest.t_ns, last.arrival_ns
    arrivals: list[int] = []
    for number, _ in reversed(ordered):
        arrival_ns = min(arrival_ns, number.t_ns + delay_ns)
        arrivals.append(arrival_ns)
    for (number, suspended), arrived_ns in zip(ordered, reversed(arrivals), strict=True):
        yield Suspended(suspended.key, suspended.payload, suspended.encoding, arrived_ns, number)


def number_of(payload: bytes, encoding: str) -> Number | None:
    """Return boot id, sequence and time of a message, None if it is not numbered."""
    kind = encoding.partition(";")[0]
    if kind == ENCODING_PACKED:
        header = read_header(payload)
        if isinstance(header, Rejection):
            return None
        _, _, sequence, boot_id, t_ns = header
        return Number(boot_id, sequence, t_ns) if boot_id else None
    frame = decode_json(payload) if kind == ENCODING_JSON else None
    if not isinstance(frame, Frame) or frame.sequence is None or not frame.boot_id:
        return None
    return Number(frame.boot_id, frame.sequence, min(frame.times()))
