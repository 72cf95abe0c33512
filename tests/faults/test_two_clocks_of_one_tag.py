"""One program stamps the motion of a tag by one clock and its ranges by another one: the service aligns both."""

from collections.abc import Callable, Iterable, Sequence
from functools import cache

import numpy as np
import pytest

from dropanchor_schemas.wire import Frame, decode_packed
from dropanchor_service.answers.care import care_of
from dropanchor_service.estimation.columns import Array, State
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.store.clock_offsets import ClockOffset
from dropanchor_tag_client.simulator.live import tag_name
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.traffic import T0_NS, known_starts, traffic

S = 1_000_000_000
MS = 1_000_000
HOUR_S = 3600.0
SECONDS, SEED = 50.0, 3
TAG = tag_name(0)
DELAYS = (20 * MS, 90 * MS, 40 * MS)
Sent = tuple[int, Frame]
"""When a message arrives, and its frame."""


@cache  # all tests send the same
def sent() -> Sequence[Sent]:
    """Return the messages of a tag that drives, both kinds in each."""
    messages = [(message.due_ns, decode_packed(message.payload)) for message in traffic(1, SECONDS, SEED, 0.1)]
    return [(due_ns + DELAYS[at % 3], frame) for at, (due_ns, frame) in enumerate(messages) if isinstance(frame, Frame)]


def with_motion_ahead(frame: Frame, ahead_s: float) -> Frame:
    return frame.replaced(imu=[s._replace(t_ns=s.t_ns + round(ahead_s * S)) for s in frame.imu])


def in_parts(messages: Iterable[Sent]) -> list[Sent]:
    """Send motion and ranges in messages of their own, from the same program."""
    parts = [
        (at_ns, part)
        for at_ns, frame in messages
        for part in (frame.replaced(ranges=[]), frame.replaced(imu=[]))
        if len(part)
    ]
    return [(at_ns, part.replaced(sequence=number)) for number, (at_ns, part) in enumerate(parts)]


class Service:
    def __init__(self) -> None:
        self.clock = ManualClock()
        self.bench = IngestBench(engine=FleetEngine(), clock=self.clock, tags=known_starts(1, SEED))

    def take(self, messages: Sequence[Sent]) -> "Service":
        for at_ns, frame in messages:
            self.clock.t_ns = at_ns
            self.bench.put(TAG, frame, at_ns=at_ns)
            self.bench.ingest.turn()
        return self

    def pose(self) -> Array:
        newest: Array = self.bench.latest.since()[1][0]
        return newest

    def offset(self) -> ClockOffset | None:
        return self.bench.publishers.clock_offset(0, self.clock.t_ns)

    def moved_s(self) -> float:
        """Return by how much the times of the motion are moved."""
        return float(self.bench.publishers.columns["motion_shift_ns"].sum()) * 1e-9


@pytest.fixture(scope="module")
def clean() -> Array:
    return Service().take(sent()).pose()


@pytest.mark.parametrize("ahead_s", [3.1, -3.1, -0.5, HOUR_S, -HOUR_S])
@pytest.mark.parametrize("arranged", [list, in_parts], ids=["one message", "a message for each kind"])
def test_the_motion_is_moved_onto_the_clock_of_the_ranges(
    arranged: Callable[[Iterable[Sent]], list[Sent]], ahead_s: float, clean: Array
) -> None:
    service = Service().take(arranged([(at_ns, with_motion_ahead(frame, ahead_s)) for at_ns, frame in sent()]))
    pose = service.pose()
    assert pose["state"] == State.TRACKING
    assert abs(int(pose["t_ns"]) - int(clean["t_ns"])) < S // 5
    assert np.hypot(pose["x"] - clean["x"], pose["y"] - clean["y"]) < 1.5
    assert service.moved_s() == pytest.approx(-ahead_s, abs=0.15)
    offset = service.offset()
    assert offset is not None
    assert offset.corrected
    assert offset.offset_s == pytest.approx(ahead_s, abs=0.15)
    tag = service.bench.tags.find(TAG)
    assert tag is not None
    [care] = care_of(tag, service.bench.health, service.clock.t_ns, offset)
    assert care["reason"] == "clock_offset"
    assert "the service corrects this" in care["hint"]


@pytest.mark.parametrize("arranged", [list, in_parts], ids=["one message", "a message for each kind"])
@pytest.mark.parametrize("ahead_s", [3.1, -3.1])
def test_a_clock_that_counts_from_boot_keeps_its_time_by_the_ranges(
    arranged: Callable[[Iterable[Sent]], list[Sent]], ahead_s: float
) -> None:
    messages = [(at_ns, with_motion_ahead(frame, ahead_s)) for at_ns, frame in sent()]
    booted = [
        (
            at_ns,
            frame.replaced(
                boot_clock=True,
                imu=[s._replace(t_ns=s.t_ns - T0_NS) for s in frame.imu],
                ranges=[s._replace(t_ns=s.t_ns - T0_NS) for s in frame.ranges],
            ),
        )
        for at_ns, frame in messages
    ]
    service = Service().take(arranged(booted))
    assert service.moved_s() == pytest.approx(-ahead_s, abs=0.15)
    assert service.pose()["state"] == State.TRACKING
    assert abs(service.clock.t_ns - int(service.pose()["t_ns"])) < S // 2


@pytest.mark.parametrize("ahead_s", [0.0, 0.15, -0.2])
def test_a_small_offset_moves_nothing(ahead_s: float) -> None:
    service = Service().take([(at_ns, with_motion_ahead(frame, ahead_s)) for at_ns, frame in sent()])
    assert service.moved_s() == 0.0
    assert service.offset() is None


def test_the_motion_goes_back_once_both_clocks_agree() -> None:
    messages = sent()
    half = len(messages) // 2
    service = Service().take([(at_ns, with_motion_ahead(frame, -3.1)) for at_ns, frame in messages[:half]])
    assert service.moved_s() == pytest.approx(3.1, abs=0.15)
    service.take(messages[half:])
    assert service.moved_s() == 0.0
    assert service.pose()["state"] == State.TRACKING


def backlog(messages: list[Sent]) -> list[Sent]:
    """Deliver the first half late and at ever shorter intervals, as caches do after an outage."""
    half, begin_ns = len(messages) // 2, messages[len(messages) // 2][0]
    late = [(begin_ns + number * 20 * MS, frame) for number, (_, frame) in enumerate(messages[:half])]
    return sorted([*late, *messages[half:]], key=lambda message: message[0])


def slow(messages: list[Sent], every: int) -> list[Sent]:
    """Leave out most ranges."""
    return [
        (at_ns, frame if at % every == 0 else frame.replaced(ranges=[])) for at, (at_ns, frame) in enumerate(messages)
    ]


def batched(messages: list[Sent], seconds: float) -> list[Sent]:
    """Send the motion and the ranges of several seconds at once."""
    size, joined = round(seconds * 10), []
    for number, begin in enumerate(range(0, len(messages) - size, size)):
        part = messages[begin : begin + size]
        imu, ranges = ([s for _, frame in part for s in getattr(frame, kind)] for kind in ("imu", "ranges"))
        joined.append((part[-1][0], part[0][1].replaced(imu=imu, ranges=ranges, sequence=number)))
    return joined


@pytest.mark.parametrize(
    "arranged",
    [backlog, lambda messages: slow(messages, 10), lambda messages: batched(messages, 2.0), in_parts],
    ids=["a backlog", "one range a second", "batches of 2 s", "a message for each kind"],
)
def test_no_way_to_deliver_makes_equal_clocks_look_apart(arranged: Callable[[list[Sent]], list[Sent]]) -> None:
    service = Service().take(arranged(list(sent())))
    assert service.moved_s() == 0.0


def test_a_backlog_is_aligned_too() -> None:
    service = Service().take(backlog([(at_ns, with_motion_ahead(frame, 3.1)) for at_ns, frame in sent()]))
    assert service.moved_s() == pytest.approx(-3.1, abs=0.3)


def test_a_replay_is_left_as_it_is() -> None:
    messages = [(at_ns, with_motion_ahead(frame, 3.1).replaced(replay=True)) for at_ns, frame in sent()]
    assert Service().take(messages).moved_s() == 0.0


def test_the_offset_survives_a_restart_from_a_checkpoint() -> None:
    messages = [(at_ns, with_motion_ahead(frame, 3.1)) for at_ns, frame in sent()]
    half = len(messages) // 2
    before, after = Service().take(messages[:half]), Service()
    after.bench.service_state().restore(before.bench.service_state().snapshot())
    assert before.moved_s() == after.moved_s() == pytest.approx(-3.1, abs=0.15)
    after.bench.ingest.turn()
    after.take(messages[half:])
    before.take(messages[half:])
    assert after.pose().tobytes() == before.pose().tobytes()
