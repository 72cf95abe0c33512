"""Messages that arrive out of order change no pose, as long as they are not later than the reorder window."""

import random
from collections import Counter
from collections.abc import Iterable

import numpy as np

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import (
    Frame,
    HeadingSample,
    ImuSample,
    RangeSample,
    decode_packed,
    encode_json,
    encode_packed,
)
from dropanchor_service.estimation.columns import POSE, Array
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.protocols import Engine
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.recording_engine import RecordingEngine
from support.traffic import T0_NS, Message, traffic

MS = 1_000_000
TAGS, SECONDS = 3, 20.0
SHUFFLE_NS, WINDOW_NS = 200 * MS, 250 * MS


def sorted_poses(engine: RecordingEngine) -> Array:
    """Return the poses that the engine returned, sorted by row and time."""
    poses = engine.poses()
    return poses[np.lexsort((poses["t_ns"], poses["row"]))]


def deliver(engine: Engine, messages: Iterable[Message]) -> IngestBench:
    """Fuse each message when it is due, then end the reorder window, so that no message is pending."""
    clock = ManualClock()
    bench = IngestBench(engine=engine, clock=clock)
    for index in range(TAGS):
        bench.ingest.announce(samples_key("default", f"sim-{index + 1}"))
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
    """Delay each of the `copies` of every message by a random time up to SHUFFLE_NS."""
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
    clean, disturbed = RecordingEngine(), RecordingEngine()
    assert deliver(clean, messages).rejected() == {}
    bench = deliver(disturbed, shuffled(messages))
    assert_the_same(sorted_poses(clean), sorted_poses(disturbed))
    assert bench.rejected() == {"duplicate": len(messages)}
    assert bench.total(bench.metrics.given_up) == 0


def test_json_messages_are_reordered_as_well() -> None:
    def as_json(message: Message) -> Message:
        frame = decode_packed(message.payload)
        assert isinstance(frame, Frame)
        return message._replace(payload=encode_json(frame))

    messages = traffic(TAGS, SECONDS, seed=8, step_s=0.2)
    clean, disturbed = RecordingEngine(), RecordingEngine()
    deliver(clean, messages)
    deliver(disturbed, [as_json(m) if i % 3 else m for i, m in enumerate(shuffled(messages))])
    assert_the_same(sorted_poses(clean), sorted_poses(disturbed))


def test_two_publishers_of_one_tag_whose_messages_are_shuffled_lose_no_range() -> None:
    messages = traffic(TAGS, SECONDS, seed=9, step_s=0.05)
    split = by_two_publishers(messages)
    clean, disturbed = RecordingEngine(), RecordingEngine()
    assert deliver(clean, split).rejected() == {}
    assert deliver(disturbed, shuffled(split, copies=1)).rejected() == {}
    assert len(sorted_poses(clean)) == len(sorted_poses(disturbed))


def by_two_publishers(messages: Iterable[Message]) -> list[Message]:
    """Split each message into inertial samples and ranges, from two publishers that number their own messages."""
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


def test_a_message_in_order_is_fused_at_once_and_a_missing_one_delays_the_next_by_the_window_only() -> None:
    clock = ManualClock()
    bench = IngestBench(clock=clock)
    for number, x in ((0, 0.0), (1, 1.0)):
        bench.put("a", ranged(number), at_ns=clock.t_ns)
        bench.ingest.turn()
        assert bench.x_of("a") == [x]
    bench.put("a", ranged(3), at_ns=clock.t_ns)
    for later_ns, x in ((0, 1.0), (WINDOW_NS - 1, 1.0), (WINDOW_NS, 3.0)):
        clock.t_ns = T0_NS + later_ns
        bench.ingest.turn()
        assert bench.x_of("a") == [x]
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


def test_a_message_later_than_the_window_is_rejected_as_late() -> None:
    clock = ManualClock()
    bench = IngestBench(engine=FleetEngine(), clock=clock)
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
