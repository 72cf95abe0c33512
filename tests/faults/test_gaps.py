"""Messages that were lost on their way come from the cache of their tag, in order; what is lost there is given up."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import zenoh

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, encode_packed
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.ingest.catch_up import MAX_RETRIES, CatchUp
from dropanchor_service.ingest.observers import Observers
from dropanchor_service.ingest.sequence_states import sequence_states
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.service import Running, running_service, settings_file, straight_north
from support.zenoh_router import connected_session, free_endpoint, running_router, wait_until

MS = 1_000_000
KEY = samples_key("default", "a")
WINDOW_NS = 250 * MS


def numbered(sequence: int, boot_id: int = 5) -> Frame:
    """Return the message of a tag that goes north with this number. They are 0.1 s apart."""
    frame = straight_north(1, t_ns=ManualClock().t_ns + sequence * 100 * MS)
    return frame.replaced(sequence=sequence, boot_id=boot_id)


class GapBench(IngestBench):
    """An ingest whose tag has a cache. asked: how often. cached: numbers of the messages in the cache."""

    def __init__(self, *cached: int, capacity: int = 10**8) -> None:
        self.recorded: list[bytes] = []
        observers = Observers(messages=lambda messages: self.recorded.extend(message[1] for message in messages))
        self.now = ManualClock()
        super().__init__(engine=FleetEngine(), clock=self.now, observers=observers, capacity=capacity)
        self.asked, self.cached = 0, cached
        self._open: list[int] = []
        states_of = sequence_states(self.sites, self.publishers)
        self.catch_up = CatchUp(self.buffer, [], states_of, self._ask, 100, now_s=lambda: 0.0)
        self.catch_up.on_first_round_answer(100)
        self.ingest.ask_on_gap(self.catch_up.on_gap)

    def _ask(self, _key: str, _missing: int, _retries: int) -> None:
        self.asked += 1
        self._open.append(1)

    def arrive(self, *sequences: int) -> None:
        """Receive messages, each 20 ms after its time, and run a turn."""
        for sequence in sequences:
            at_ns = ManualClock().t_ns + sequence * 100 * MS + 20 * MS
            self.now.t_ns = at_ns
            self.catch_up.on_live(KEY, encode_packed(numbered(sequence)), ENCODING_PACKED, at_ns)
        self.ingest.turn()

    def answer(self) -> None:
        """Let the cache answer until it is not asked again."""
        while self._open:
            self._open.clear()
            for sequence in self.cached:
                payload = encode_packed(numbered(sequence))
                self.catch_up.on_cached(KEY, payload, ENCODING_PACKED, self.now.t_ns)
            self.catch_up.on_answer(KEY, 100)
        self.ingest.turn()

    def used(self) -> float:
        """Return how many messages were used: each has one range."""
        return self.total(self.metrics.samples, kind="range")


def test_a_gap_that_the_cache_holds_is_filled_in_order() -> None:
    bench = GapBench(2, 3, 4, 5)
    bench.arrive(0, 1, 2, 5, 6, 7)
    bench.arrive(8, 9)
    assert bench.used() == 3
    bench.answer()
    assert bench.used() == 10
    assert bench.rejected().keys() <= {"imu_stuck"}  # the IMU of this tag never changes
    assert bench.total(bench.metrics.given_up) == 0
    assert bench.asked == 1
    bench.arrive(10)
    assert bench.used() == 11


def test_messages_of_longer_than_the_window_that_are_processed_at_once_give_nothing_up() -> None:
    bench = GapBench(2, 3, 4, 5)
    bench.arrive(0, 1, 2, *range(5, 15))
    bench.answer()
    assert bench.used() == 15
    assert bench.total(bench.metrics.given_up) == 0


def test_messages_that_waited_for_a_cache_are_counted_and_recorded_once() -> None:
    bench = GapBench(2, 3, 4, 5)
    bench.arrive(0, 1, 2, 5, 6)
    bench.answer()
    assert bench.recorded == [encode_packed(numbered(sequence)) for sequence in range(7)]
    assert bench.total(bench.metrics.messages) == 7


def test_a_gap_that_the_cache_no_longer_holds_is_given_up_once() -> None:
    bench = GapBench(5, 6)
    bench.arrive(0, 1, 2, 5, 6)
    bench.answer()
    bench.arrive(7)
    assert bench.used() == 3
    bench.now.t_ns += WINDOW_NS
    bench.ingest.turn()
    bench.arrive(8)
    assert bench.used() == 7
    assert bench.total(bench.metrics.given_up) == 2
    assert bench.rejected().keys() <= {"imu_stuck"}  # the IMU of this tag never changes
    assert bench.asked == 1


def test_a_tag_without_a_cache_is_asked_at_its_first_gap_and_then_waits_no_longer_than_the_window() -> None:
    bench = GapBench()
    bench.arrive(0)
    for behind, asked in ((2, 1 + MAX_RETRIES), (4, 1 + MAX_RETRIES)):
        bench.arrive(behind)
        bench.answer()
        assert bench.used() == behind / 2
        bench.now.t_ns += WINDOW_NS
        bench.ingest.turn()
        assert bench.used() == behind / 2 + 1
        assert bench.asked == asked
    assert bench.total(bench.metrics.given_up) == 2


def test_messages_that_were_shed_are_not_asked_for() -> None:
    bench = GapBench(capacity=40_000)
    bench.arrive(0)
    bench.arrive(*range(1, 500))
    while bench.buffer.depth:
        bench.ingest.turn()
    assert bench.rejected()["shed"] > 0
    assert bench.used() + bench.rejected()["shed"] == 500
    assert bench.asked == 0


def has_used(service: Running, messages: int) -> bool:
    return service.metric('dropanchor_samples_total{kind="range"}') == messages


@contextmanager
def cache_of(session: zenoh.Session, frames: list[Frame]) -> Iterator[None]:
    """Answer queries for cached messages."""

    def answer(query: Any) -> None:
        with query:
            for frame in frames:
                query.reply(KEY, encode_packed(frame), encoding=ENCODING_PACKED)

    queryable = session.declare_queryable(f"{KEY}/@adv/pub/1/1/_", zenoh.handlers.Callback(answer))
    yield
    queryable.undeclare()


def test_what_zenoh_does_not_recover_is_fetched_from_the_cache(tmp_path: Path) -> None:
    """Zenoh numbers nothing here, so that it notices no loss."""
    endpoint, config = free_endpoint(), settings_file(tmp_path, ["a"], "[ingest]\nreorder_ms = 10000")
    options = ("--config", str(config), "--zenoh-connect", endpoint)
    with running_router(endpoint), running_service(*options) as service, connected_session(endpoint) as tag:
        now_ns = time.time_ns()
        frames = [straight_north(1, now_ns + number * MS).replaced(sequence=number, boot_id=5) for number in range(10)]
        published: list[Frame] = []
        with cache_of(tag, published):
            for newest in (0, 5, 9):
                published[:] = frames[: newest + 1]
                tag.put(KEY, encode_packed(frames[newest]), encoding=ENCODING_PACKED)
                wait_until(partial(has_used, service, newest + 1))
        assert service.metric("dropanchor_given_up_messages_total") == 0
        assert service.metric('dropanchor_rejected_total{reason="late"}') == 0


def test_a_message_that_is_too_large_for_zenoh_is_missed(tmp_path: Path) -> None:
    with (
        running_service("--config", str(settings_file(tmp_path, ["a"]))) as service,
        connected_session(service.zenoh) as tag,
    ):
        now_ns = time.time_ns()
        first, last = (straight_north(1, now_ns + at * MS).replaced(sequence=at, boot_id=5) for at in (0, 2))
        tag.put(KEY, encode_packed(first), encoding=ENCODING_PACKED)
        wait_until(partial(has_used, service, 1))
        tag.put(KEY, b"\1" * 2**21, encoding=ENCODING_PACKED)
        tag.put(KEY, encode_packed(last), encoding=ENCODING_PACKED)
        wait_until(partial(has_used, service, 2))
        assert service.metric("dropanchor_given_up_messages_total") == 1
        assert service.metric('dropanchor_rejected_total{reason="payload_too_large"}') == 0
