"""The period of the ingest follows how many messages come, and how long their tags gathered samples."""

import pytest

from dropanchor_schemas.wire import Frame, RangeSample
from dropanchor_service.ingest.period import Period
from dropanchor_service.ingest.thread import IngestThread
from support.ingest import IngestBench
from support.zenoh_router import wait_until

T, MS = 1_760_000_000_000_000_000, 1_000_000
SHORTEST_S = 0.02


def period_after(messages: int, elapsed_s: float, span_s: float, shortest_s: float = SHORTEST_S) -> float:
    period = Period(shortest_s)
    period.adapt(messages, elapsed_s, span_s)
    return period.current_s


def test_few_messages_wait_for_three_quarters_of_the_time_for_which_their_tags_gathered_samples() -> None:
    assert period_after(5, 0.02, span_s=0.19) == pytest.approx(0.1425)


def test_no_message_waits_longer_than_150_ms() -> None:
    assert period_after(5, 0.02, span_s=10.0) == 0.15


def test_messages_of_single_samples_do_not_wait() -> None:
    assert period_after(5, 0.02, span_s=0.0) == SHORTEST_S


def test_the_period_is_the_shortest_while_many_messages_come() -> None:
    assert period_after(100, 0.02, span_s=0.19) == SHORTEST_S


def test_between_few_and_many_messages_a_turn_takes_about_fifty() -> None:
    assert period_after(20, 0.02, span_s=0.19) == pytest.approx(0.05)


def test_a_turn_without_messages_changes_nothing() -> None:
    period = Period(SHORTEST_S)
    period.adapt(5, 0.02, 0.19)
    period.adapt(0, 1.0, 0.0)
    assert period.current_s == pytest.approx(0.1425)


@pytest.mark.parametrize(("shortest_s", "longest_s"), [(0.002, 0.015), (0.5, 0.5)])
def test_the_setting_bounds_the_period(shortest_s: float, longest_s: float) -> None:
    assert period_after(1, 1.0, 10.0, shortest_s) == pytest.approx(longest_s)


def test_the_thread_gathers_longer_when_few_messages_hold_samples_of_a_long_time() -> None:
    bench, period = IngestBench(), Period(SHORTEST_S)
    bench.send("a", Frame(ranges=[RangeSample(T, 7, 4.0)]))
    thread = IngestThread(bench.ingest, bench.buffer, bench.metrics, period)
    thread.start()
    bench.put("a", Frame(ranges=[RangeSample(T + 100 * MS, 7, 4.0), RangeSample(T + 200 * MS, 7, 4.0)]))
    wait_until(lambda: period.current_s == pytest.approx(0.075))
    bench.put("a", Frame(ranges=[RangeSample(T + 300 * MS, 7, 4.0)]))
    wait_until(lambda: period.current_s == SHORTEST_S)
    thread.stop()


@pytest.mark.parametrize(("shortest_s", "gathering_s"), [(0.02, 0.004), (1.0, 0.03)])
def test_arrival_times_are_wrong_by_30_ms_at_most(shortest_s: float, gathering_s: float) -> None:
    assert Period(shortest_s).gathering_s == pytest.approx(gathering_s)


def test_a_message_without_usable_samples_does_not_shorten_the_period() -> None:
    bench = IngestBench()
    bench.send("a", Frame(ranges=[RangeSample(T, 7, 4.0)]))
    bench.put("a", Frame(ranges=[RangeSample(T + 100 * MS, 7, 4.0), RangeSample(T + 200 * MS, 7, 4.0)]))
    bench.put("b", Frame(ranges=[RangeSample(T, 7, -4.0)]))
    bench.put("b", Frame(ranges=[RangeSample(T, 7, -4.0)]))
    bench.ingest.turn()
    assert bench.ingest.span_s >= 0.1
