"""Caches are asked for what is missing between two messages: once for each gap, and only those that may answer."""

from dropanchor_service.ingest import catch_up
from dropanchor_service.ingest.publishers import SequenceState
from service.ingest.catch_up_bench import LIMIT, NEW, CatchUpBench, behind_a_gap, cached, live

RUNNING = SequenceState(next=4, seen=0b1111)


def bench_of_a_running_tag(*boot_ids: int) -> CatchUpBench:
    """Return a catch-up after the first round, with a tag whose publishers have sent the numbers up to 3."""
    bench = CatchUpBench({NEW: dict.fromkeys(boot_ids or (1,), RUNNING)})
    bench.catch_up.on_first_round_answer(LIMIT)
    return bench


def answer(bench: CatchUpBench, *sequences: int, boot_id: int = 1) -> None:
    cached(bench, *sequences, boot_id=boot_id, key=NEW)
    bench.catch_up.on_answer(NEW, LIMIT)


def give_up(bench: CatchUpBench) -> None:
    """Let the caches give no answer as often as they are asked at the first gap."""
    for _ in range(catch_up.MAX_RETRIES):
        answer(bench)
        assert bench.sequences() == []
    answer(bench)


def test_what_is_missing_is_released_before_the_messages_that_wait_for_it() -> None:
    bench = bench_of_a_running_tag()
    assert behind_a_gap(bench, 6, 7, key=NEW)
    live(bench, 8, key=NEW)
    assert behind_a_gap(bench, 9, key=NEW)  # was in the buffer meanwhile
    assert bench.released() == []
    assert (bench.asked, bench.missing) == ([NEW], [4])
    answer(bench, 3, 4, 5, 6)
    assert bench.sequences() == [4, 5, 6, 7, 8, 9]
    live(bench, 10, key=NEW)
    assert bench.sequences() == [10]


def test_the_same_gap_is_asked_for_once_and_the_next_one_again() -> None:
    bench = bench_of_a_running_tag()
    assert behind_a_gap(bench, 6, 7, key=NEW)
    answer(bench, 6, 7)
    assert bench.sequences() == [6, 7]
    assert not behind_a_gap(bench, 6, 7, key=NEW)
    assert not behind_a_gap(bench, 8, 9, key=NEW)
    assert behind_a_gap(bench, 10, 12, key=NEW)
    answer(bench, 10, 11, 12)
    assert bench.sequences() == [10, 11, 12]
    assert bench.asked == [NEW, NEW]


def test_numbers_that_wrap_around_are_the_same_gap() -> None:
    bench = CatchUpBench({NEW: {1: SequenceState(next=2**32 - 3, seen=0)}})
    bench.catch_up.on_first_round_answer(LIMIT)
    assert behind_a_gap(bench, 2**32 - 1, key=NEW)
    answer(bench, 2**32 - 1)
    assert not behind_a_gap(bench, 0, key=NEW)
    assert behind_a_gap(bench, 2, key=NEW)


def test_a_tag_without_caches_waits_at_one_gap_until_it_announces_itself_anew() -> None:
    bench = bench_of_a_running_tag()
    assert behind_a_gap(bench, 6, key=NEW)
    give_up(bench)
    assert bench.sequences() == [6]
    assert not behind_a_gap(bench, 9, key=NEW)
    bench.catch_up.on_alive(NEW)
    assert behind_a_gap(bench, 12, key=NEW)
    assert bench.asked == [NEW] * (catch_up.MAX_RETRIES + 2)


def test_caches_that_are_announced_late_fill_the_first_gap() -> None:
    bench = bench_of_a_running_tag()
    assert behind_a_gap(bench, 6, key=NEW)
    answer(bench)
    answer(bench, 4, 5, 6)
    assert bench.sequences() == [4, 5, 6]


def test_caches_that_take_their_time_and_do_not_answer_are_waited_for_five_seconds_at_the_first_gap() -> None:
    bench = bench_of_a_running_tag()
    assert behind_a_gap(bench, 6, key=NEW)
    answer(bench)
    bench.now_s = catch_up.PATIENCE_S
    answer(bench)
    assert bench.sequences() == [6]


def test_caches_that_used_to_answer_are_asked_for_five_seconds() -> None:
    bench = bench_of_a_running_tag()
    assert behind_a_gap(bench, 6, key=NEW)
    answer(bench, 4, 5, 6)
    assert bench.sequences() == [4, 5, 6]
    assert behind_a_gap(bench, 9, key=NEW)
    for _ in range(2 * catch_up.MAX_RETRIES):
        answer(bench)
    assert bench.sequences() == []
    bench.now_s = catch_up.PATIENCE_S
    answer(bench)
    assert bench.sequences() == [9]
    assert behind_a_gap(bench, 12, key=NEW)  # one more chance
    give_up(bench)
    assert bench.sequences() == [12]
    assert not behind_a_gap(bench, 15, key=NEW)


def test_a_hole_in_an_answer_is_asked_for_again() -> None:
    bench = bench_of_a_running_tag()
    assert behind_a_gap(bench, 7, key=NEW)
    answer(bench, 4, 6)
    assert bench.sequences() == []
    answer(bench, 4, 5, 6)
    assert bench.sequences() == [4, 5, 6, 7]


def test_the_other_publisher_of_the_tag_waits_too_and_all_are_merged_in_order_of_time() -> None:
    bench = bench_of_a_running_tag(1, 2)
    assert behind_a_gap(bench, 6, boot_id=1, key=NEW)
    live(bench, 4, boot_id=2, key=NEW)
    live(bench, 5, boot_id=2, key=NEW)
    assert bench.released() == []
    answer(bench, 4, 5, boot_id=1)
    assert bench.sequences() == [4, 4, 5, 5, 6]


def test_a_publisher_without_a_cache_beside_one_that_has_one_is_not_asked_again() -> None:
    bench = bench_of_a_running_tag(1, 2)
    assert behind_a_gap(bench, 6, boot_id=1, key=NEW)
    for _ in range(catch_up.MAX_RETRIES + 1):
        assert bench.sequences() == []
        answer(bench, 3, boot_id=2)
    assert bench.sequences() == [6]
    assert not behind_a_gap(bench, 9, boot_id=1, key=NEW)
    assert behind_a_gap(bench, 6, boot_id=2, key=NEW)
    live(bench, 12, boot_id=1, key=NEW)
    answer(bench, 4, 5, boot_id=2)
    assert bench.sequences() == [4, 5, 6, 12]


def test_a_publisher_that_is_first_heard_in_mid_stream_is_not_asked() -> None:
    bench = bench_of_a_running_tag()
    assert not behind_a_gap(bench, 6, boot_id=9, key=NEW)
    assert bench.asked == []


def test_messages_that_come_back_while_they_are_released_are_not_lost() -> None:
    bench = bench_of_a_running_tag()
    assert behind_a_gap(bench, 6, 7, key=NEW)
    bench.before(7, lambda: None if behind_a_gap(bench, 6, key=NEW) else bench.asked.append("refused"))
    give_up(bench)
    assert bench.sequences() == [6, 7, 6]
    assert bench.asked == [NEW] * (catch_up.MAX_RETRIES + 1)


def test_in_an_overload_no_cache_is_asked_for_a_gap() -> None:
    bench = bench_of_a_running_tag()
    bench.flood(0, 20)
    assert bench.is_overloaded
    assert not behind_a_gap(bench, 6, key=NEW)
    assert bench.asked == []


def test_an_answer_for_a_gap_does_not_end_an_overload() -> None:
    bench = bench_of_a_running_tag()
    assert behind_a_gap(bench, 6, key=NEW)
    bench.flood(0, 20)
    answer(bench, 4, 5)
    bench.flood(20, 21)
    assert bench.is_overloaded
