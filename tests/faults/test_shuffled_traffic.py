"""What networks do to the order of messages changes no pose, as long as it stays inside the window."""

import random
from collections import Counter
from collections.abc import Iterable

import numpy as np

from dropanchor_schemas.wire import (
    Frame,
    HeadingSample,
    ImuSample,
    RangeSample,
    decode_packed,
    encode_json,
    encode_packed,
)
from dropanchor_service.estimation.columns import POSE, Array, Engine, PoseBatch, SampleBatch
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.runtime.clock import UtcClock
from support.ingest import Bench
from support.traffic import T0_NS, Message, traffic

MS = 1_000_000
TAGS, SECONDS = 3, 20.0
SHUFFLE_NS, WINDOW_NS = 200 * MS, 250 * MS


class Recorded(FleetEngine):
    """Keeps the poses that it gave."""

    def __init__(self) -> None:
        super().__init__()
        self.given: list[Array] = [np.zeros(0, POSE)]

    def process(self, samples: SampleBatch) -> PoseBatch:
        batch = super().process(samples)
        self.given.append(batch.poses.copy())
        return batch

    def poses(self) -> Array:
        """Of all rows, by row and time."""
        poses = np.concatenate(self.given)
        return poses[np.lexsort((poses["t_ns"], poses["row"]))]


class SetClock(UtcClock):
    """Shows what it is set to."""

    def __init__(self) -> None:
        super().__init__()
        self.t_ns = T0_NS

    def now_ns(self) -> int:
        return self.t_ns


def deliver(engine: Engine, messages: Iterable[Message]) -> Bench:
    """Each message at its time, a turn after every message, and turns until nothing waits any more."""
    clock = SetClock()
    bench = Bench(engine=engine, clock=clock)
    for index in range(TAGS):
        bench.ingest.announce(f"sim-{index + 1}")
    for message in messages:
        clock.t_ns = message.due_ns
        encoding = "application/json" if message.payload[:1] == b"{" else "application/vnd.dropanchor.samples"
        bench.put(message.tag, message.payload, encoding, at_ns=message.due_ns)
        bench.ingest.turn()
    clock.t_ns += WINDOW_NS
    bench.ingest.turn()
    assert not bench.ingest.has_pending
    return bench


def shuffled(messages: Iterable[Message], copies: int = 2) -> list[Message]:
    """Every copy of a message is late by anything up to SHUFFLE_NS."""
    dice = random.Random(11)
    late = [
        message._replace(due_ns=message.due_ns + dice.randrange(SHUFFLE_NS))
        for message in messages
        for _ in range(copies)
    ]
    return sorted(late, key=lambda message: message.due_ns)


def assert_the_same(one: Array, other: Array) -> None:
    assert len(one) == len(other) > 100 * TAGS
    for name in POSE.names or ():
        np.testing.assert_allclose(one[name], other[name], rtol=0, atol=1e-9, err_msg=name)


def test_shuffled_and_doubled_messages_give_the_poses_of_the_clean_run() -> None:
    messages = traffic(TAGS, SECONDS, seed=8, step_s=0.05)
    clean, harmed = Recorded(), Recorded()
    assert deliver(clean, messages).rejected() == {}
    bench = deliver(harmed, shuffled(messages))
    assert_the_same(clean.poses(), harmed.poses())
    assert bench.rejected() == {"duplicate": len(messages)}
    assert bench.total(bench.metrics.given_up) == 0


def test_json_is_put_in_order_as_well() -> None:
    def as_json(message: Message) -> Message:
        frame = decode_packed(message.payload)
        assert isinstance(frame, Frame)
        return message._replace(payload=encode_json(frame))

    messages = traffic(TAGS, SECONDS, seed=8, step_s=0.2)
    clean, harmed = Recorded(), Recorded()
    deliver(clean, messages)
    deliver(harmed, [as_json(m) if i % 3 else m for i, m in enumerate(shuffled(messages))])
    assert_the_same(clean.poses(), harmed.poses())


def test_publishers_of_one_tag_that_are_shuffled_each_for_itself_lose_no_range() -> None:
    messages = traffic(TAGS, SECONDS, seed=9, step_s=0.05)
    split = by_two_publishers(messages)
    clean, harmed = Recorded(), Recorded()
    assert deliver(clean, split).rejected() == {}
    assert deliver(harmed, shuffled(split, copies=1)).rejected() == {}
    assert len(clean.poses()) == len(harmed.poses())


def by_two_publishers(messages: Iterable[Message]) -> list[Message]:
    """The inertial samples and the ranges of each tag apart; each publisher numbers its own messages."""
    numbers: Counter[int] = Counter()
    split: list[Message] = []
    for message in messages:
        frame = decode_packed(message.payload)
        assert isinstance(frame, Frame)
        assert frame.boot_id is not None
        parts = {frame.boot_id: Frame(imu=frame.imu), frame.boot_id + 1000: Frame(ranges=frame.ranges)}
        for boot_id, part in parts.items():
            if len(part):
                part.boot_id, part.sequence = boot_id, numbers[boot_id]
                numbers[boot_id] += 1
                split.append(message._replace(payload=encode_packed(part)))
    return split


def test_a_message_in_order_waits_for_nothing_and_one_that_never_comes_delays_by_no_more_than_the_window() -> None:
    clock = SetClock()
    bench = Bench(clock=clock)
    for number, seen in ((0, 0.0), (1, 1.0)):
        bench.put("a", ranged(number), at_ns=clock.t_ns)
        bench.ingest.turn()
        assert bench.x_of("a") == [seen]
    bench.put("a", ranged(3), at_ns=clock.t_ns)
    for later_ns, seen in ((0, 1.0), (WINDOW_NS - 1, 1.0), (WINDOW_NS, 3.0)):
        clock.t_ns = T0_NS + later_ns
        bench.ingest.turn()
        assert bench.x_of("a") == [seen]
    assert bench.total(bench.metrics.given_up) == 1


def ranged(number: int) -> Frame:
    t_ns = T0_NS + number * 100 * MS
    return Frame(
        imu=[ImuSample(t_ns, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0))],
        ranges=[RangeSample(t_ns, 7, float(number))],
        headings=[HeadingSample(t_ns, 0.0)],
        sequence=number,
        boot_id=5,
    )


def test_what_comes_later_than_the_window_is_late_and_counted() -> None:
    clock, engine = SetClock(), Recorded()
    bench = Bench(engine=engine, clock=clock)
    for number in (0, 1, 3, 4):
        bench.put("a", ranged(number), at_ns=clock.t_ns)
    bench.ingest.turn()
    clock.t_ns += WINDOW_NS
    bench.ingest.turn()
    bench.put("a", ranged(2), at_ns=clock.t_ns)
    bench.ingest.turn()
    assert bench.total(bench.metrics.given_up) == 1
    assert bench.rejected()["late"] > 0
    bench.put("a", ranged(2), at_ns=clock.t_ns)
    bench.ingest.turn()
    assert bench.rejected()["duplicate"] == 1
