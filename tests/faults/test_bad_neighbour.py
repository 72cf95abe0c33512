"""A faulty tag harms no other tag: the poses of its neighbours stay the same to the last bit."""

import logging
import math
import random
import time
from collections import defaultdict
from collections.abc import Iterator

import numpy as np
import pytest

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import Frame, ImuSample, RangeSample, encode_packed
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.protocols import Engine
from support.ingest import IngestBench
from support.recording_engine import RecordingEngine
from support.traffic import T0_NS, Message, traffic

TAGS = 3
SECONDS = 60.0
MANY, SETTLED = 50, 100  # number of tags in the benchmark, and number of turns before it measures
_log = logging.getLogger(__name__)

HOUR_NS = 3_600_000_000_000
EXTREMES = (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-45, -1.0, 0.0)


def test_a_tag_that_sends_garbage_for_a_minute_changes_no_bit_of_its_neighbours() -> None:
    good = traffic(TAGS, SECONDS, seed=5)
    clean, disturbed = RecordingEngine(), RecordingEngine()
    feed(clean, good)
    bench = feed(disturbed, sorted([*good, *garbage()], key=lambda message: message.due_ns))
    assert poses_of_good_tags(disturbed) == poses_of_good_tags(clean)
    rejected = bench.rejected()
    assert {"not_finite", "range_negative", "range_absurd", "imu_absurd", "header_truncated"} <= set(rejected)
    assert not bench.faults()


def test_a_row_that_makes_the_engine_fail_changes_no_bit_of_its_neighbours() -> None:
    good = traffic(TAGS, 20.0, seed=6)
    clean = RecordingEngine()
    feed(clean, good)
    bad_row = TAGS
    failing = RecordingEngine(fails=lambda samples: bool((samples.ranges["row"] == bad_row).any()))
    bench = feed(failing, sorted([*good, *ordinary("bad", 20.0)], key=lambda message: message.due_ns))
    assert poses_of_good_tags(failing) == poses_of_good_tags(clean)
    assert bench.faults()["estimator"] >= 3
    assert bench.rejected()["estimator_fault"] > 0


@pytest.mark.benchmark
def test_a_bad_neighbour_costs_the_others_no_latency() -> None:
    """A good message waits until its turn ends, so the turns are timed, alternately with and without the bad tag."""
    good = traffic(MANY, SECONDS, seed=7, step_s=0.1)
    bad = sorted([*good, *garbage()], key=lambda message: message.due_ns)
    times_s = {"without": list[float](), "with": list[float]()}
    runs = zip(turns(good, MANY), turns(bad, MANY), strict=True)
    for clean, disturbed in runs:
        times_s["without"].append(clean)
        times_s["with"].append(disturbed)
    for percentile in (50, 99):
        without, disturbed = (float(np.percentile(times[SETTLED:], percentile)) for times in times_s.values())
        _log.info(
            "A turn of %d tags takes %.2f ms (p%d); a bad tag beside them makes it %.3f times as long.",
            MANY,
            1e3 * without,
            percentile,
            disturbed / without,
        )
    assert disturbed < 1.1 * without


def turns(messages: list[Message], tags: int) -> Iterator[float]:
    """Yield the processor time of each turn in s. Each turn fuses the messages of 0.1 s."""
    bench = IngestBench(engine=FleetEngine())
    for index in range(tags):
        bench.ingest.announce(samples_key("default", f"sim-{index + 1}"))
    together: dict[int, list[Message]] = defaultdict(list)
    for message in messages:
        together[(message.due_ns - T0_NS) // 100_000_000].append(message)
    for index in range(round(SECONDS / 0.1)):
        for message in together[index]:
            bench.put(message.tag, message.payload, at_ns=message.due_ns)
        began_s = time.thread_time()
        bench.ingest.turn()
        yield time.thread_time() - began_s


def feed(engine: Engine, messages: list[Message]) -> IngestBench:
    """Fuse all messages, with one turn for those that are due together. The good tags get the rows 0 to TAGS - 1."""
    bench = IngestBench(engine=engine)
    for index in range(TAGS):
        bench.ingest.announce(samples_key("default", f"sim-{index + 1}"))
    due_ns = messages[0].due_ns
    for message in messages:
        if message.due_ns != due_ns:
            bench.ingest.turn()
            due_ns = message.due_ns
        bench.put(message.tag, message.payload, at_ns=message.due_ns)
    bench.ingest.turn()
    return bench


def poses_of_good_tags(engine: RecordingEngine) -> list[bytes]:
    """Return the bytes of the poses of each good tag, in the order in which the engine returned them."""
    poses = engine.poses()
    own = [poses[poses["row"] == row] for row in range(TAGS)]
    assert min(len(column) for column in own) > 100
    return [column.tobytes() for column in own]


def ordinary(tag: str, seconds: float) -> Iterator[Message]:
    """Yield a message with one plausible range every 0.2 s."""
    for index in range(int(seconds / 0.2)):
        t_ns = T0_NS + index * 200_000_000
        yield Message(t_ns, tag, encode_packed(Frame(ranges=[RangeSample(t_ns, 1, 5.0)])))


def garbage() -> Iterator[Message]:
    """Yield, five times a second, extreme values with a jumping clock, a cut frame and random bytes."""
    dice = random.Random(11)
    for index in range(int(SECONDS / 0.2)):
        due_ns = T0_NS + index * 200_000_000
        t_ns = due_ns + dice.choice([0, HOUR_NS, -HOUR_NS, -T0_NS])
        value = [dice.choice(EXTREMES) for _ in range(11)]
        frame = Frame(
            imu=[
                ImuSample(
                    t_ns, (value[0], value[1], 9.8), (value[2], value[3], value[4]), (value[5], value[6], value[7])
                )
            ],
            ranges=[RangeSample(t_ns, 1, value[8], value[9]), RangeSample(t_ns, 1, 4_000.0), RangeSample(t_ns, 1, 7.0)],
            sequence=dice.randrange(2**32),
            boot_id=dice.randrange(1, 2**32),
        )
        payload = encode_packed(frame)
        yield Message(due_ns, "bad", payload)
        yield Message(due_ns, "bad", payload[: dice.randrange(len(payload))])
        yield Message(due_ns, "bad", dice.randbytes(dice.randrange(200)))
