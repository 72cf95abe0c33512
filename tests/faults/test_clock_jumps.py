"""A tag's clock is set by an hour or back to zero while it drives: its track goes on, and no other tag notices."""

import struct

import numpy as np
import pytest

from dropanchor_service.estimation.columns import Array, State
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_tag_client.simulator.live import start_poses, tag_name
from support.ingest import Bench
from support.traffic import T0_NS, Message, traffic

S = 1_000_000_000
HOUR = 3600 * S
TAGS, SECONDS, SEED = 2, 20.0, 3
JUMPS_NS = T0_NS + 10 * S
DELAY_NS = 20_000_000


class SetClock(UtcClock):
    """Shows what it is set to."""

    t_ns = T0_NS

    def now_ns(self) -> int:
        return self.t_ns


def with_jump(message: Message, jump_ns: int) -> Message:
    """The first tag's clock is set by so much when it jumps."""
    if message.tag != tag_name(0) or message.due_ns < JUMPS_NS:
        return message
    t0_ns = struct.unpack_from("<q", message.payload, 16)[0] + jump_ns
    return message._replace(payload=message.payload[:16] + struct.pack("<q", t0_ns) + message.payload[24:])


def run(messages: list[Message]) -> tuple[Bench, list[Array]]:
    """The latest poses after every message, each a delay after it was due."""
    clock = SetClock()
    starts = {
        tag_name(index): {"start": {"x": pose.x, "y": pose.y, "heading_rad": pose.heading_rad}}
        for index, pose in enumerate(start_poses(TAGS, SEED))
    }
    bench = Bench(engine=FleetEngine(), clock=clock, tags=starts)
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


@pytest.mark.parametrize("jump_ns", [HOUR, -HOUR, -T0_NS], ids=["an hour on", "an hour back", "to zero"])
def test_a_clock_that_is_set_costs_its_tag_nothing_and_no_other_tag_a_bit(
    messages: list[Message], clean: list[Array], jump_ns: int
) -> None:
    bench, seen = run([with_jump(message, jump_ns) for message in messages])
    after = [index for index, message in enumerate(messages) if message.due_ns >= JUMPS_NS + S]
    for index in after:
        jumped, undisturbed = seen[index][0], clean[index][0]
        assert abs(int(jumped["t_ns"]) - int(undisturbed["t_ns"])) < S  # a new epoch within a second
        assert np.hypot(jumped["x"] - undisturbed["x"], jumped["y"] - undisturbed["y"]) < 0.2
    assert seen[-1]["state"].tolist() == [State.TRACKING, State.TRACKING]
    assert [poses[1:].tobytes() for poses in seen] == [poses[1:].tobytes() for poses in clean]
    assert bench.rejected() == {}
    assert bench.total(bench.metrics.clock_jumps) == 1
