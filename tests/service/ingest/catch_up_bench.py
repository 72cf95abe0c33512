"""A catch-up without a network, and the messages that it takes in and releases."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, RangeSample, encode_packed
from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_service.ingest.decode import read_forms
from dropanchor_service.ingest.publishers import SequenceState

S = 1_000_000_000
LIMIT = 100  # messages that a cache was asked for
T0 = 1_760_000_000 * S
A, B, NEW = (samples_key("default", tag) for tag in ("a", "b", "new"))


class Released(NamedTuple):
    """A message that was passed to the buffer."""

    key: str
    boot_id: int
    sequence: int
    arrival_ns: int


class InterruptedBuffer(MessageBuffer):
    """before: function to call just before a message is added, by the payload of the message."""

    def __init__(self) -> None:
        super().__init__(10**8)
        self.before: dict[bytes, Callable[[], None]] = {}

    def append(self, key: str, payload: bytes, encoding: str, arrival_ns: int, cached: bool = False) -> None:
        self.before.pop(payload, lambda: None)()
        super().append(key, payload, encoding, arrival_ns, cached)


class CatchUpBench:
    """A catch-up that expects the tags a and b, and the messages that it releases. now_s: its clock."""

    def __init__(self, states: Mapping[str, Mapping[int, SequenceState]] = MappingProxyType({})) -> None:
        self.asked: list[str] = []
        self.missing: list[int] = []
        self.now_s = 0.0
        self._buffer = InterruptedBuffer()
        for row, key in enumerate((A, B, NEW)):
            self._buffer.admit(key, row)
        self.catch_up = CatchUp(
            self._buffer,
            [A, B],
            lambda key: states.get(key, {}),
            self._ask,
            new_publisher_limit=4,
            now_s=lambda: self.now_s,
        )

    def _ask(self, key: str, missing: int, _retries: int) -> None:
        self.asked.append(key)
        self.missing.append(missing)

    def before(self, sequence: int, happens: Callable[[], None]) -> None:
        self._buffer.before[payload(sequence, measured_ns(sequence))] = happens

    @property
    def is_overloaded(self) -> bool:
        return self._buffer.is_overloaded

    def flood(self, first: int, last: int) -> None:
        """Send five messages of a tag in each tenth of a second from `first` to `last`, and take one of them."""
        for tenth in range(first, last):
            now_ns = measured_ns(tenth)
            for _ in range(5):
                self._buffer.append(A, payload(tenth, now_ns), ENCODING_PACKED, now_ns)
            self._buffer.drain(1, now_ns)

    def released(self) -> list[Released]:
        messages, _ = self._buffer.drain(1000)
        forms = read_forms([m[1] for m in messages], [m[2] for m in messages]).forms
        return [
            Released((A, B, NEW)[m[0]], int(f["boot_id"]), int(f["sequence"]), m[3])
            for m, f in zip(messages, forms, strict=True)
        ]

    def sequences(self) -> list[int]:
        return [message.sequence for message in self.released()]


def payload(sequence: int, t_ns: int, boot_id: int = 1) -> bytes:
    return encode_packed(Frame(ranges=[RangeSample(t_ns, 7, 1.0)], sequence=sequence, boot_id=boot_id))


def measured_ns(sequence: int) -> int:
    """Return the time of a message: 0.1 s after the one before."""
    return T0 + sequence * S // 10


def live(bench: CatchUpBench, sequence: int, delay_ns: int = 20_000_000, boot_id: int = 1, key: str = A) -> None:
    t_ns = measured_ns(sequence)
    bench.catch_up.on_live(key, payload(sequence, t_ns, boot_id), ENCODING_PACKED, t_ns + delay_ns)


def cached(bench: CatchUpBench, *sequences: int, boot_id: int = 1, key: str = A) -> None:
    for sequence in sequences:
        content = payload(sequence, measured_ns(sequence), boot_id)
        bench.catch_up.on_cached(key, content, ENCODING_PACKED, T0 + 100 * S)


def behind_a_gap(bench: CatchUpBench, *sequences: int, boot_id: int = 1, key: str = A) -> bool:
    """Offer messages that came before one with a smaller number. Return whether they are suspended."""
    return bench.catch_up.on_gap(
        key,
        [
            (0, payload(sequence, measured_ns(sequence), boot_id), ENCODING_PACKED, measured_ns(sequence) + 20_000_000)
            for sequence in sequences
        ],
    )
