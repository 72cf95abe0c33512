"""Publishers whose clocks count from boot: neither a killed service nor network delays change a pose."""

import logging
import random
import struct
from collections import defaultdict
from collections.abc import Iterable

import numpy as np
import pytest

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import ENCODING_PACKED, FLAG_BOOT_CLOCK, Frame, decode_packed, encode_packed
from dropanchor_service.answers.kernels.ageing import CHI2_95_OF_2
from dropanchor_service.estimation.columns import POSE, Array
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_tag_client.simulator.live import tag_name
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.traffic import T0_NS, Message, known_starts, traffic

S = 1_000_000_000
MS = 1_000_000
TAGS, SECONDS, SEED = 3, 90.0, 3
MIN_DELAY_NS = 5 * MS
BOOTED_NS = T0_NS - 1000 * S
KEYS = [samples_key("default", tag_name(index)) for index in range(TAGS)]

_log = logging.getLogger(__name__)


class Run:
    """A service without threads, new or with the state of an earlier one, and the poses that it returned."""

    def __init__(self, before: "Run | None" = None) -> None:
        self.clock = ManualClock()
        self.bench = IngestBench(engine=FleetEngine(), clock=self.clock, tags=known_starts(TAGS, SEED))
        self.returned = [np.zeros(0, POSE)]
        if before is not None:
            self.bench.service_state().restore(before.bench.service_state().snapshot())
            self.returned = list(before.returned)
            self.bench.ingest.turn()  # registers the restored tags with the buffer

    def fuse(self, messages: Iterable[Message]) -> None:
        """Fuse one message after the other, each at the time when it is due."""
        for message in messages:
            self.clock.t_ns = message.due_ns
            self.bench.put(message.tag, message.payload, at_ns=message.due_ns)
            self.turn()

    def turn(self) -> None:
        """Fuse one message."""
        self.bench.ingest.turn(1)
        self.returned.append(self.bench.latest.since()[1].copy())

    def catch_up(self, cached: Iterable[Message], live: Iterable[Message], asked_ns: int) -> None:
        """Fetch missed messages from the caches, which answer at `asked_ns`. Live messages are suspended until then."""
        publishers, tags = self.bench.publishers, self.bench.tags
        states = {samples_key("default", tag.name): publishers.sequence_states(tag.row) for tag in tags.all()}
        catch_up = CatchUp(self.bench.buffer, KEYS, lambda key: states[key], lambda *_: None, 1000)
        for message in live:
            catch_up.on_live(samples_key("default", message.tag), message.payload, ENCODING_PACKED, message.due_ns)
        for message in cached:
            catch_up.on_cached(samples_key("default", message.tag), message.payload, ENCODING_PACKED, asked_ns)
        catch_up.on_first_round_answer(10_000)
        self.clock.t_ns = asked_ns + S
        while self.bench.buffer.depth:
            self.turn()

    def poses(self) -> dict[int, Array]:
        """Return the poses by row, in order of time and without duplicates."""
        every = np.concatenate(self.returned)
        by_row = {int(row): every[every["row"] == row] for row in np.unique(every["row"])}
        return {row: poses[np.unique(poses["t_ns"], return_index=True)[1]] for row, poses in by_row.items()}


def on_boot_clocks(messages: Iterable[Message]) -> list[Message]:
    """Make the times of all messages count from BOOTED_NS, and flag them so."""
    return [message._replace(payload=on_boot_clock(message.payload)) for message in messages]


def on_boot_clock(payload: bytes) -> bytes:
    t0_ns = struct.unpack_from("<q", payload, 16)[0] - BOOTED_NS
    return payload[:1] + bytes([FLAG_BOOT_CLOCK]) + payload[2:16] + struct.pack("<q", t0_ns) + payload[24:]


def delivered(messages: Iterable[Message], seed: int, mean_ms: float = 10.0) -> list[Message]:
    """Delay each message by a random time. The messages of one tag keep their order."""
    dice, free = random.Random(seed), defaultdict[str, int](int)
    late = []
    for message in messages:
        delay_ns = MIN_DELAY_NS + round(dice.expovariate(1 / mean_ms) * MS)
        free[message.tag] = max(free[message.tag] + 1, message.due_ns + delay_ns)
        late.append(message._replace(due_ns=free[message.tag]))
    return sorted(late, key=lambda message: message.due_ns)


def run(messages: Iterable[Message]) -> Run:
    fresh = Run()
    fresh.fuse(messages)
    return fresh


def assert_equal_up_to_a_time_shift(one: Run, other: Run, max_shift_ns: int) -> None:
    """Compare the times to within `max_shift_ns`, and every other field bit for bit."""
    for row, poses in one.poses().items():
        others = other.poses()[row]
        assert len(poses) == len(others) > 400
        shift_ns = abs(poses["t_ns"] - others["t_ns"])
        assert shift_ns.max() < max_shift_ns
        for name in set(POSE.names or ()) - {"t_ns"}:
            np.testing.assert_array_equal(poses[name], others[name], err_msg=name)


@pytest.fixture(scope="module")
def messages() -> list[Message]:
    return on_boot_clocks(traffic(TAGS, SECONDS, SEED))


@pytest.fixture(scope="module")
def undisturbed(messages: list[Message]) -> Run:
    return run(delivered(messages, 1))


@pytest.mark.parametrize("mean_ms", [3.0, 10.0, 40.0])
def test_network_delays_change_the_time_of_a_pose_and_nothing_else(
    messages: list[Message], undisturbed: Run, mean_ms: float
) -> None:
    other = run(delivered(messages, 2, mean_ms))
    assert other.bench.rejected() == {}
    assert_equal_up_to_a_time_shift(undisturbed, other, 250 * MS)


@pytest.mark.parametrize("down_s", [2, 40])
def test_a_service_restarted_from_a_checkpoint_and_the_caches_gives_the_same_poses(
    messages: list[Message], undisturbed: Run, down_s: int
) -> None:
    every, killed_ns = delivered(messages, 1), T0_NS + 30 * S
    back_ns, asked_ns = killed_ns + down_s * S, killed_ns + (down_s + 1) * S
    before = run(message for message in every if message.due_ns <= killed_ns - S)
    after = Run(before)
    cached = [
        message for message in every if message.due_ns <= asked_ns
    ]  # caches also return messages that are not missing
    after.catch_up(cached, [message for message in cached if message.due_ns > back_ns], asked_ns)
    after.fuse(message for message in every if message.due_ns > asked_ns)
    assert after.bench.rejected() == {}
    assert_equal_up_to_a_time_shift(undisturbed, after, 20 * MS)


def by_two(messages: Iterable[Message]) -> list[Message]:
    """Split each message between two publishers: inertial samples from one, ranges from another that booted later."""
    parts = []
    for message in messages:
        frame = decode_packed(message.payload)
        assert isinstance(frame, Frame)
        ranges = [sample._replace(t_ns=sample.t_ns - 77 * S) for sample in frame.ranges]
        # The ranges are not numbered, because not every message has one.
        for part in (frame.replaced(ranges=[]), frame.replaced(imu=[], ranges=ranges, boot_id=0)):
            if part.imu or part.ranges:
                parts.append(message._replace(payload=encode_packed(part)))
    return parts


def test_two_boot_clocks_of_a_tag_leave_its_poses_within_their_ellipses() -> None:
    parts = by_two(on_boot_clocks(traffic(TAGS, 60.0, SEED, step_s=0.1)))
    one, other = (run(delivered(parts, seed)) for seed in (1, 2))
    assert one.bench.rejected() == other.bench.rejected() == {}
    for row, poses in one.poses().items():
        others = other.poses()[row]
        assert len(poses) == len(others) > 270
        apart = np.stack([poses[axis] for axis in "xy"], axis=1) - np.stack([others[axis] for axis in "xy"], axis=1)
        outside = np.einsum("ki,kij,kj->k", apart, np.linalg.inv(poses["cov"][:, :2, :2]), apart)
        _log.info(
            "The largest distance is %.3g m, the largest chi squared %.3g.", np.hypot(*apart.T).max(), outside.max()
        )
        assert outside.max() < CHI2_95_OF_2
