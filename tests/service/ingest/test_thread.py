"""The ingest thread survives errors, gathers messages, and reports when it is not running."""

import threading

import pytest

from dropanchor_schemas.wire import Frame, RangeSample
from dropanchor_service.ingest import thread as ingest_thread
from dropanchor_service.ingest.period import Period
from dropanchor_service.ingest.thread import IngestThread
from support.ingest import IngestBench
from support.zenoh_router import wait_until

T = 1_760_000_000_000_000_000


def frame(value: float) -> Frame:
    return Frame(ranges=[RangeSample(T, 7, value)])


def thread_of(bench: IngestBench) -> IngestThread:
    return IngestThread(bench.ingest, bench.buffer, bench.metrics, Period(0.001))


def test_messages_become_poses() -> None:
    bench = IngestBench()
    thread = thread_of(bench)
    thread.start()
    bench.put("a", frame(4.0))
    wait_until(lambda: bench.x_of("a") == [4.0])
    assert thread.problem is None
    thread.stop()
    assert not thread.is_alive


def test_an_unexpected_error_is_counted_and_the_thread_continues(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = IngestBench()
    turn, failures = bench.ingest.turn, 3

    def failing(limit: int) -> int:
        nonlocal failures
        if failures:
            failures -= 1
            raise RuntimeError("a bug")
        return turn(limit)

    monkeypatch.setattr(bench.ingest, "turn", failing)
    thread = thread_of(bench)
    thread.start()
    bench.put("a", frame(4.0))
    wait_until(lambda: bench.x_of("a") == [4.0])
    thread.stop()
    assert bench.faults() == {"ingest": 3}


def test_a_thread_that_is_not_running_or_stuck_is_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = IngestBench()
    thread = thread_of(bench)
    assert thread.problem == "the ingest thread is not running"
    release = threading.Event()
    monkeypatch.setattr(bench.ingest, "turn", lambda _: release.wait(60.0))
    monkeypatch.setattr(ingest_thread, "SILENT_S", 0.05)
    thread.start()
    wait_until(lambda: "stuck" in (thread.problem or ""))
    release.set()
    thread.stop()


def test_no_turn_is_taken_while_the_process_may_not_serve() -> None:
    bench, may_turn = IngestBench(), threading.Event()
    thread = IngestThread(bench.ingest, bench.buffer, bench.metrics, Period(0.001), may_turn=may_turn.is_set)
    thread.start()
    bench.put("a", frame(4.0))
    assert not may_turn.wait(0.3)
    assert (bench.buffer.depth, thread.problem) == (1, None)
    may_turn.set()
    wait_until(lambda: bench.x_of("a") == [4.0])
    thread.stop()
