"""A tag's clock jumps by an hour or to zero while it drives: its track goes on, and no other tag is affected."""

import struct

import numpy as np
import pytest

from dropanchor_service.estimation.columns import Array, State
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_tag_client.simulator.live import tag_name
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.traffic import T0_NS, Message, known_starts, traffic

S = 1_000_000_000
HOUR = 3600 * S
TAGS, SECONDS, SEED = 2, 20.0, 3
JUMP_AT_NS = T0_NS + 10 * S
DELAY_NS = 20_000_000


def with_jump(message: Message, jump_ns: int) -> Message:
    """Shift the times of the first tag by `jump_ns` from JUMP_AT_NS on. Other messages stay as they are."""
    if message.tag != tag_name(0) or message.due_ns < JUMP_AT_NS:
        return message
    t0_ns = struct.unpack_from("<q", message.payload, 16)[0] + jump_ns
    return message._replace(payload=message.payload[:16] + struct.pack("<q", t0_ns) + message.payload[24:])


def run(messages: list[Message]) -> tuple[IngestBench, list[Array]]:
    """Fuse each message DELAY_NS after it was due. Return the bench, and the latest poses after every message."""
    clock = ManualClock()
    bench = IngestBench(engine=FleetEngine(), clock=clock, tags=known_starts(TAGS, SEED))
    seen = []
    for message in messages:
        clock.t_ns = message.due_ns + DELAY_NS
        bench.put(message.tag, message.payload, at_ns=clock.t_ns)
        bench.ingest.turn()
        seen.append(bench.latest.since()[1])
    return bench, seen


@pytest.fixture(scope="module")
def messages() -> list[Message]:
    return traffic(TAGS, SECONDS, SEED)


@pytest.fixture(scope="module")
def clean(messages: list[Message]) -> list[Array]:
    return run(messages)[1]


@pytest.mark.parametrize("jump_ns", [HOUR, -HOUR, -T0_NS], ids=["an hour forward", "an hour back", "to zero"])
def test_a_clock_jump_costs_its_tag_no_pose_and_changes_no_bit_of_another_tag(
    messages: list[Message], clean: list[Array], jump_ns: int
) -> None:
    bench, seen = run([with_jump(message, jump_ns) for message in messages])
    after = [index for index, message in enumerate(messages) if message.due_ns >= JUMP_AT_NS + S]
    for index in after:
        jumped, undisturbed = seen[index][0], clean[index][0]
        assert abs(int(jumped["t_ns"]) - int(undisturbed["t_ns"])) < S  # a new epoch within a second
        assert np.hypot(jumped["x"] - undisturbed["x"], jumped["y"] - undisturbed["y"]) < 0.2
    assert seen[-1]["state"].tolist() == [State.TRACKING, State.TRACKING]
    assert [poses[1:].tobytes() for poses in seen] == [poses[1:].tobytes() for poses in clean]
    assert bench.rejected() == {}
    assert bench.total(bench.metrics.clock_jumps) == 1
