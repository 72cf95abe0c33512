"""Messages from caches are released before live ones: once, in order, and only for tags that are catching up."""

from threading import Thread

import pytest

from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Frame, HeadingSample, encode_json
from dropanchor_service.ingest import catch_up
from dropanchor_service.ingest.publishers import SequenceState
from service.ingest.catch_up_bench import LIMIT, NEW, T0, A, B, CatchUpBench, S, cached, live, payload


def test_live_messages_wait_for_those_from_caches_and_each_is_released_once() -> None:
    bench = CatchUpBench()
    live(bench, 5)
    live(bench, 6)
    cached(bench, 3, 2, 5, 4)
    assert bench.released() == []
    assert bench.catch_up.on_first_round_answer(LIMIT) == 5
    live(bench, 7)
    assert bench.sequences() == [2, 3, 4, 5, 6, 7]
    assert bench.asked == []


def test_the_caches_of_a_listed_tag_that_starts_are_not_asked() -> None:
    bench = CatchUpBench({B: {1: SequenceState(next=4, seen=0b1111)}})
    bench.catch_up.on_first_round_answer(LIMIT)
    for sequence in (0, 1):
        live(bench, sequence)
    assert bench.sequences() == [0, 1]
    assert bench.asked == []
    live(bench, 0, boot_id=2, key=B)  # its caches may hold more of the publisher that the last process knew
    assert bench.released() == []
    assert bench.asked == [B]


def test_messages_that_were_fused_before_the_restart_are_left_out() -> None:
    bench = CatchUpBench({A: {1: SequenceState(next=4, seen=0b1111)}})
    cached(bench, 2, 3, 4)
    cached(bench, 2, boot_id=9)
    cached(bench, 2, key=B)
    bench.catch_up.on_first_round_answer(LIMIT)
    assert sorted((message.key, message.boot_id, message.sequence) for message in bench.released()) == [
        (A, 1, 4),
        (A, 9, 2),
        (B, 1, 2),
    ]


def test_what_is_on_its_way_to_the_estimator_is_not_released_again() -> None:
    states = {A: {1: SequenceState(next=4, seen=0b1111)}}
    bench = CatchUpBench(states)
    cached(bench, 4, 5, 6)
    bench.catch_up.on_first_round_answer(LIMIT)
    bench.catch_up.on_silent(A)
    cached(bench, 4, 5, 6, 7, 8)  # the estimator has taken none of them yet, and its caches are asked again
    bench.catch_up.on_answer(A, LIMIT)
    assert bench.sequences() == [4, 5, 6, 7, 8]
    states[A] = {1: SequenceState(next=8, seen=0b10011111)}  # 5 and 6 were shed; 8 is still on its way
    bench.catch_up.on_silent(A)
    cached(bench, 4, 5, 6, 7, 8)
    bench.catch_up.on_answer(A, LIMIT)
    assert bench.sequences() == [5, 6]


def test_messages_from_caches_get_arrivals_with_the_delay_of_the_newest() -> None:
    bench = CatchUpBench()
    live(bench, 5, delay_ns=30_000_000)
    cached(bench, 3, 4)
    bench.catch_up.on_first_round_answer(LIMIT)
    assert [message.arrival_ns - T0 for message in bench.released()] == [330_000_000, 430_000_000, 530_000_000]


def test_two_publishers_of_one_tag_are_merged_in_order_of_time() -> None:
    bench = CatchUpBench()
    for boot_id, sequences in ((1, (2, 3, 4)), (2, (3, 4, 5))):
        cached(bench, *sequences[:2], boot_id=boot_id)
        live(bench, sequences[2], boot_id=boot_id)
    bench.catch_up.on_first_round_answer(LIMIT)
    assert bench.sequences() == [2, 3, 3, 4, 4, 5]


def test_a_clock_that_was_set_back_does_not_change_the_order_of_the_numbers() -> None:
    bench = CatchUpBench()
    for sequence, t_ns in ((1, T0), (2, T0 + S), (3, T0 - 3600 * S), (4, T0 - 3599 * S)):
        bench.catch_up.on_cached(A, payload(sequence, t_ns), ENCODING_PACKED, T0 + 3 * S)
    bench.catch_up.on_first_round_answer(LIMIT)
    assert bench.sequences() == [1, 2, 3, 4]


def test_numbers_that_wrap_around_stay_in_order() -> None:
    bench = CatchUpBench()
    for sequence in (2**32 - 1, 1, 2**32 - 2, 0):
        t_ns = T0 + (sequence + 2) % 2**32 * S
        bench.catch_up.on_cached(A, payload(sequence, t_ns), ENCODING_PACKED, T0 + 10 * S)
    bench.catch_up.on_first_round_answer(LIMIT)
    assert bench.sequences() == [2**32 - 2, 2**32 - 1, 0, 1]


def test_json_and_unnumbered_messages_are_released_too() -> None:
    bench = CatchUpBench()
    for sequence in (2, 1):
        frame = Frame(headings=[HeadingSample(T0 + sequence, 0.1)], sequence=sequence, boot_id=1)
        bench.catch_up.on_cached(A, encode_json(frame), ENCODING_JSON, T0 + 10)
    for content, encoding in (
        (encode_json(Frame(headings=[HeadingSample(T0 + 5, 0.1)])), ENCODING_JSON),
        (payload(0, T0, boot_id=0), ENCODING_PACKED),
        (b"junk", ENCODING_PACKED),
        (b"{", ENCODING_JSON),
        (b"", "text/plain"),
    ):
        bench.catch_up.on_live(A, content, encoding, T0 + 20)
    assert bench.catch_up.on_first_round_answer(LIMIT) == 7
    assert bench.sequences()[:2] == [1, 2]


def test_the_caches_of_a_tag_that_sends_later_are_asked_while_other_tags_are_live() -> None:
    bench = CatchUpBench()
    bench.catch_up.on_first_round_answer(LIMIT)
    live(bench, 1, key=NEW)
    live(bench, 5, key=B)
    live(bench, 6, key=B)
    assert bench.asked == [B]
    assert [message.key for message in bench.released()] == [NEW]
    cached(bench, 4, key=B)
    bench.catch_up.on_answer(B, LIMIT)
    live(bench, 7, key=B)
    assert bench.sequences() == [4, 5, 6, 7]
    assert bench.asked == [B]


def test_the_caches_of_a_silent_tag_that_is_online_are_asked_too() -> None:
    bench = CatchUpBench()
    bench.catch_up.on_first_round_answer(LIMIT)
    bench.catch_up.on_alive(A)
    bench.catch_up.on_alive(NEW)
    assert bench.asked == [A]
    cached(bench, 1, 2)
    bench.catch_up.on_answer(A, LIMIT)
    assert bench.sequences() == [1, 2]


def test_caches_that_did_not_answer_in_the_first_round_are_asked_again_if_their_tag_sends() -> None:
    bench = CatchUpBench()
    live(bench, 5)
    live(bench, 5, key=NEW)
    bench.catch_up.on_first_round_answer(LIMIT)
    assert bench.asked == [A]
    assert [message.key for message in bench.released()] == [NEW]
    cached(bench, 4)
    bench.catch_up.on_answer(A, LIMIT)
    assert bench.sequences() == [4, 5]


def test_caches_whose_answer_was_cut_short_are_asked_for_all_that_is_missing() -> None:
    bench = CatchUpBench({A: {1: SequenceState(next=4, seen=0b1111)}})
    live(bench, 10)
    live(bench, 10, boot_id=2, key=NEW)
    live(bench, 6, key=B)
    cached(bench, 8, 9)
    cached(bench, 8, 9, boot_id=2, key=NEW)
    cached(bench, 5, key=B)
    bench.catch_up.on_first_round_answer(2)
    assert dict(zip(bench.asked, bench.missing, strict=True)) == {A: 7, NEW: 4}
    assert [message.key for message in bench.released()] == [B, B]
    cached(bench, *range(4, 10))
    bench.catch_up.on_answer(A, 7)
    assert bench.sequences() == [4, 5, 6, 7, 8, 9, 10]
    cached(bench, *range(6, 10), boot_id=2, key=NEW)
    bench.catch_up.on_answer(NEW, 4)
    assert bench.sequences() == [6, 7, 8, 9, 10]
    assert len(bench.asked) == 2


def test_caches_are_asked_again_for_missing_messages_a_limited_number_of_times() -> None:
    bench = CatchUpBench({B: {1: SequenceState(next=4, seen=0b1111)}})
    live(bench, 9)
    cached(bench, 5, 6, 7)
    live(bench, 6, key=B)
    bench.catch_up.on_first_round_answer(LIMIT)
    assert sorted(bench.asked) == [A, B]
    cached(bench, 6, 7, 8)
    bench.catch_up.on_answer(A, LIMIT)
    assert bench.sequences() == [5, 6, 7, 8, 9]
    for _ in range(catch_up.MAX_RETRIES):
        assert bench.sequences() == []
        bench.catch_up.on_answer(B, LIMIT)
    assert bench.sequences() == [6]
    assert bench.asked.count(A) == 1
    assert bench.asked.count(B) == catch_up.MAX_RETRIES


def test_messages_of_several_tags_are_released_in_order_of_time() -> None:
    bench = CatchUpBench()
    for key in (B, A):
        cached(bench, 1, 2, 3, key=key)
        live(bench, 4, key=key)
    bench.catch_up.on_first_round_answer(LIMIT)
    assert bench.sequences() == [1, 1, 2, 2, 3, 3, 4, 4]


def test_live_messages_do_not_overtake_those_that_are_being_released() -> None:
    bench = CatchUpBench()
    cached(bench, 1)
    live(bench, 2)
    newest = Thread(target=live, args=(bench, 4))

    def send_the_newest() -> None:
        newest.start()
        newest.join(0.2)  # it may have to wait for those before it

    bench.before(2, lambda: live(bench, 3))
    bench.before(3, send_the_newest)
    bench.catch_up.on_first_round_answer(LIMIT)
    newest.join()
    assert bench.sequences() == [1, 2, 3, 4]


def test_the_size_of_suspended_messages_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catch_up, "MAX_BYTES", 1000)
    bench = CatchUpBench()
    for sequence in range(1, 20):
        live(bench, sequence)
    sequences = bench.sequences()
    assert sequences == list(range(1, len(sequences) + 1))
    assert len(sequences) >= 15


def test_a_silent_tag_is_asked_until_its_caches_answer() -> None:
    bench = CatchUpBench({NEW: {1: SequenceState(3, 0b110)}})
    bench.catch_up.on_first_round_answer(LIMIT)
    bench.catch_up.on_silent(NEW)
    bench.catch_up.on_answer(NEW, LIMIT)
    assert bench.asked == [NEW, NEW]
    cached(bench, 2, 3, 4, key=NEW)
    bench.catch_up.on_answer(NEW, LIMIT)
    assert bench.asked == [NEW, NEW]
    assert bench.sequences() == [3, 4]


def test_a_silent_tag_whose_caches_do_not_answer_is_asked_a_limited_number_of_times() -> None:
    bench = CatchUpBench({NEW: {1: SequenceState(3, 0b110)}})
    bench.catch_up.on_first_round_answer(LIMIT)
    bench.catch_up.on_silent(NEW)
    for _ in range(2 * catch_up.MAX_RETRIES):
        bench.catch_up.on_answer(NEW, LIMIT)
    assert len(bench.asked) == 1 + catch_up.MAX_RETRIES
    live(bench, 3, key=NEW)
    assert bench.sequences() == [3]
