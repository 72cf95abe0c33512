"""What was fetched from caches goes on before what is live: once, in order, and only where somebody waits for it."""

from collections.abc import Callable, Mapping
from threading import Thread
from types import MappingProxyType
from typing import NamedTuple

import pytest

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import (
    ENCODING_JSON,
    ENCODING_PACKED,
    Frame,
    HeadingSample,
    RangeSample,
    encode_json,
    encode_packed,
)
from dropanchor_service.ingest import catch_up
from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_service.ingest.decode import read_forms
from dropanchor_service.ingest.publishers import SequenceState

S = 1_000_000_000
MOST = 100  # messages that a cache was asked for
T0 = 1_760_000_000 * S
A, B, NEW = (samples_key("default", tag) for tag in ("a", "b", "new"))


class Came(NamedTuple):
    """What went on to the buffer."""

    key: str
    boot_id: int
    sequence: int
    arrival_ns: int


class Interrupted(MessageBuffer):
    """before: what happens just before a message goes in, by its payload."""

    def __init__(self) -> None:
        super().__init__(10**8)
        self.before: dict[bytes, Callable[[], None]] = {}

    def append(self, key: str, payload: bytes, encoding: str, arrival_ns: int, cached: bool = False) -> None:
        self.before.pop(payload, lambda: None)()
        super().append(key, payload, encoding, arrival_ns, cached)


class House:
    """A catch-up that expects the tags a and b, and what goes on from it."""

    def __init__(self, passed: Mapping[str, Mapping[int, SequenceState]] = MappingProxyType({})) -> None:
        self.asked: list[str] = []
        self.missing: list[int] = []
        self._buffer = Interrupted()
        for row, key in enumerate((A, B, NEW)):
            self._buffer.admit(key, row)
        self.catch_up = CatchUp(self._buffer, [A, B], lambda key: passed.get(key, {}), self._ask, most_of_new=4)

    def _ask(self, key: str, missing: int, _tries: int) -> None:
        self.asked.append(key)
        self.missing.append(missing)

    def before(self, sequence: int, happens: Callable[[], None]) -> None:
        self._buffer.before[payload(sequence, measured_ns(sequence))] = happens

    def came(self) -> list[Came]:
        messages, _ = self._buffer.drain(1000)
        forms = read_forms([m[1] for m in messages], [m[2] for m in messages]).forms
        return [
            Came((A, B, NEW)[m[0]], int(f["boot_id"]), int(f["sequence"]), m[3])
            for m, f in zip(messages, forms, strict=True)
        ]

    def sequences(self) -> list[int]:
        return [message.sequence for message in self.came()]


def payload(sequence: int, t_ns: int, boot_id: int = 1) -> bytes:
    return encode_packed(Frame(ranges=[RangeSample(t_ns, 7, 1.0)], sequence=sequence, boot_id=boot_id))


def measured_ns(sequence: int) -> int:
    """A tenth of a second after the one before."""
    return T0 + sequence * S // 10


def live(house: House, sequence: int, delay_ns: int = 20_000_000, boot_id: int = 1, key: str = A) -> None:
    t_ns = measured_ns(sequence)
    house.catch_up.hear(key, payload(sequence, t_ns, boot_id), ENCODING_PACKED, t_ns + delay_ns)


def cached(house: House, *sequences: int, boot_id: int = 1, key: str = A) -> None:
    for sequence in sequences:
        content = payload(sequence, measured_ns(sequence), boot_id)
        house.catch_up.fetch(key, content, ENCODING_PACKED, T0 + 100 * S)


def test_what_is_live_waits_for_what_was_fetched_and_each_comes_once() -> None:
    house = House()
    live(house, 5)
    live(house, 6)
    cached(house, 3, 2, 5, 4)
    assert house.came() == []
    assert house.catch_up.first_round_answered(MOST) == 5
    live(house, 7)
    assert house.sequences() == [2, 3, 4, 5, 6, 7]
    assert house.asked == []


def test_a_listed_tag_that_begins_is_not_asked_for_what_it_cannot_have() -> None:
    house = House({B: {1: SequenceState(next=4, seen=0b1111)}})
    house.catch_up.first_round_answered(MOST)
    for sequence in (0, 1):
        live(house, sequence)
    assert house.sequences() == [0, 1]
    assert house.asked == []
    live(house, 0, boot_id=2, key=B)  # the last process knew a publisher of it that may have more
    assert house.came() == []
    assert house.asked == [B]


def test_what_was_fused_before_the_restart_is_left_out() -> None:
    house = House({A: {1: SequenceState(next=4, seen=0b1111)}})
    cached(house, 2, 3, 4)
    cached(house, 2, boot_id=9)
    cached(house, 2, key=B)
    house.catch_up.first_round_answered(MOST)
    assert sorted((message.key, message.boot_id, message.sequence) for message in house.came()) == [
        (A, 1, 4),
        (A, 9, 2),
        (B, 1, 2),
    ]


def test_fetched_messages_get_the_arrival_that_the_delay_of_the_newest_implies() -> None:
    house = House()
    live(house, 5, delay_ns=30_000_000)
    cached(house, 3, 4)
    house.catch_up.first_round_answered(MOST)
    assert [message.arrival_ns - T0 for message in house.came()] == [330_000_000, 430_000_000, 530_000_000]


def test_two_publishers_of_one_tag_are_merged_in_order_of_time() -> None:
    house = House()
    for boot_id, sequences in ((1, (2, 3, 4)), (2, (3, 4, 5))):
        cached(house, *sequences[:2], boot_id=boot_id)
        live(house, sequences[2], boot_id=boot_id)
    house.catch_up.first_round_answered(MOST)
    assert house.sequences() == [2, 3, 3, 4, 4, 5]


def test_a_clock_that_was_set_back_meanwhile_leaves_the_order_of_the_numbers() -> None:
    house = House()
    for sequence, t_ns in ((1, T0), (2, T0 + S), (3, T0 - 3600 * S), (4, T0 - 3599 * S)):
        house.catch_up.fetch(A, payload(sequence, t_ns), ENCODING_PACKED, T0 + 3 * S)
    house.catch_up.first_round_answered(MOST)
    assert house.sequences() == [1, 2, 3, 4]


def test_numbers_that_wrap_stay_in_order() -> None:
    house = House()
    for sequence in (2**32 - 1, 1, 2**32 - 2, 0):
        t_ns = T0 + (sequence + 2) % 2**32 * S
        house.catch_up.fetch(A, payload(sequence, t_ns), ENCODING_PACKED, T0 + 10 * S)
    house.catch_up.first_round_answered(MOST)
    assert house.sequences() == [2**32 - 2, 2**32 - 1, 0, 1]


def test_json_and_messages_without_a_number_go_on_too() -> None:
    house = House()
    for sequence in (2, 1):
        frame = Frame(headings=[HeadingSample(T0 + sequence, 0.1)], sequence=sequence, boot_id=1)
        house.catch_up.fetch(A, encode_json(frame), ENCODING_JSON, T0 + 10)
    for content, encoding in (
        (encode_json(Frame(headings=[HeadingSample(T0 + 5, 0.1)])), ENCODING_JSON),
        (payload(0, T0, boot_id=0), ENCODING_PACKED),
        (b"junk", ENCODING_PACKED),
        (b"{", ENCODING_JSON),
        (b"", "text/plain"),
    ):
        house.catch_up.hear(A, content, encoding, T0 + 20)
    assert house.catch_up.first_round_answered(MOST) == 7
    assert house.sequences()[:2] == [1, 2]


def test_a_tag_that_is_heard_later_is_asked_by_itself_while_others_go_on() -> None:
    house = House()
    house.catch_up.first_round_answered(MOST)
    live(house, 1, key=NEW)
    live(house, 5, key=B)
    live(house, 6, key=B)
    assert house.asked == [B]
    assert [message.key for message in house.came()] == [NEW]
    cached(house, 4, key=B)
    house.catch_up.answered(B, MOST)
    live(house, 7, key=B)
    assert house.sequences() == [4, 5, 6, 7]
    assert house.asked == [B]


def test_a_tag_that_is_there_but_silent_is_asked_too() -> None:
    house = House()
    house.catch_up.first_round_answered(MOST)
    house.catch_up.appear(A)
    house.catch_up.appear(NEW)
    assert house.asked == [A]
    cached(house, 1, 2)
    house.catch_up.answered(A, MOST)
    assert house.sequences() == [1, 2]


def test_a_tag_that_is_heard_in_the_first_round_without_an_answer_of_its_caches_is_asked_again() -> None:
    house = House()
    live(house, 5)
    live(house, 5, key=NEW)
    house.catch_up.first_round_answered(MOST)
    assert house.asked == [A]
    assert [message.key for message in house.came()] == [NEW]
    cached(house, 4)
    house.catch_up.answered(A, MOST)
    assert house.sequences() == [4, 5]


def test_a_tag_whose_answer_was_cut_short_is_asked_for_all_that_is_missing() -> None:
    house = House({A: {1: SequenceState(next=4, seen=0b1111)}})
    live(house, 10)
    live(house, 10, boot_id=2, key=NEW)
    live(house, 6, key=B)
    cached(house, 8, 9)
    cached(house, 8, 9, boot_id=2, key=NEW)
    cached(house, 5, key=B)
    house.catch_up.first_round_answered(2)
    assert dict(zip(house.asked, house.missing, strict=True)) == {A: 7, NEW: 4}
    assert [message.key for message in house.came()] == [B, B]
    cached(house, *range(4, 10))
    house.catch_up.answered(A, 7)
    assert house.sequences() == [4, 5, 6, 7, 8, 9, 10]
    cached(house, *range(6, 10), boot_id=2, key=NEW)
    house.catch_up.answered(NEW, 4)
    assert house.sequences() == [6, 7, 8, 9, 10]
    assert len(house.asked) == 2


def test_a_hole_or_silence_where_something_is_missing_is_asked_for_again_and_again_but_not_for_ever() -> None:
    house = House({B: {1: SequenceState(next=4, seen=0b1111)}})
    live(house, 9)
    cached(house, 5, 6, 7)
    live(house, 6, key=B)
    house.catch_up.first_round_answered(MOST)
    assert sorted(house.asked) == [A, B]
    cached(house, 6, 7, 8)
    house.catch_up.answered(A, MOST)
    assert house.sequences() == [5, 6, 7, 8, 9]
    for _ in range(catch_up.TRIES):
        assert house.sequences() == []
        house.catch_up.answered(B, MOST)
    assert house.sequences() == [6]
    assert house.asked.count(A) == 1
    assert house.asked.count(B) == catch_up.TRIES


def test_what_goes_on_of_several_tags_goes_on_in_order_of_time() -> None:
    house = House()
    for key in (B, A):
        cached(house, 1, 2, 3, key=key)
        live(house, 4, key=key)
    house.catch_up.first_round_answered(MOST)
    assert house.sequences() == [1, 1, 2, 2, 3, 3, 4, 4]


def test_what_is_heard_while_messages_go_on_overtakes_none_of_them() -> None:
    house = House()
    cached(house, 1)
    live(house, 2)
    newest = Thread(target=live, args=(house, 4))

    def hear_the_newest() -> None:
        newest.start()
        newest.join(0.2)  # it may have to wait for those before it

    house.before(2, lambda: live(house, 3))
    house.before(3, hear_the_newest)
    house.catch_up.first_round_answered(MOST)
    newest.join()
    assert house.sequences() == [1, 2, 3, 4]


def test_what_is_held_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catch_up, "MOST_BYTES", 1000)
    house = House()
    for sequence in range(1, 20):
        live(house, sequence)
    came = house.sequences()
    assert came == list(range(1, len(came) + 1))
    assert len(came) >= 15
