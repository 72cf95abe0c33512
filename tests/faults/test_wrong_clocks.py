"""The clock of the host or of a tag is wrong, across restarts: poses keep their true times, and one cause is named.

The engine returns a pose for each range, so that its time can be compared with the true one.
"""

import logging
from collections.abc import Iterator, Sequence
from random import Random

import numpy as np
import pytest

from dropanchor_schemas.wire import Frame, RangeSample
from dropanchor_service.answers.care import care_of
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.observers import Observers
from dropanchor_service.store.tags import Tag
from support.ingest import IngestBench, TransparentEngine
from support.manual_clock import ManualClock
from support.traffic import T0_NS

S = 1_000_000_000
HOUR_S, DAY_S = 3600.0, 86_400.0
STEP_S, BATCH_S = 0.2, 2.0  # between two live messages, and between two of a backlog
NOISE_S = 2.1  # by which clocks that are right may differ
FOUND_S = 30.0  # after which a cause is named


class Engine(TransparentEngine):
    """An engine that goes on from a checkpoint."""

    def state(self) -> dict[str, Array]:
        return {"rows": np.array(list(self.configured), np.int32)}

    def restore(self, state: dict[str, Array]) -> None:
        self.configured = {row: [] for row in state["rows"].tolist()}


def frame(true_s: float, error_s: float, number: int, boot_id: int, ranges: int = 2) -> Frame:
    """Return ranges up to a time, by a clock that is ahead by `error_s`. Each range tells its true time, in s."""
    times = [true_s - STEP_S * (ranges - 1 - at) / ranges for at in range(ranges)]
    samples = [RangeSample(T0_NS + round((t_s + error_s) * S), 1, 1.0 + t_s * 1e-3) for t_s in times]
    return Frame(ranges=samples, sequence=number, boot_id=boot_id)


class World:
    """A host, a service without threads, and tags. Times are true seconds since T0_NS."""

    def __init__(self, tags: Sequence[float], host_s: float = 0.0) -> None:
        """tags: how far the clock of each is ahead. host_s: how far the clock of the host is ahead."""
        self.t_s, self.errors_s, self.numbers = 0.0, tags, [0] * len(tags)
        self.ages_s: list[float] = []
        self._start(host_s)

    def _start(self, host_s: float) -> None:
        self.host_s = host_s
        self.clock = ManualClock()
        self.set_clock()
        site = {"anchors": [{"id": "1"}]}
        self.bench = IngestBench(engine=Engine(), clock=self.clock, observers=Observers(poses=self._keep), site=site)
        self.late_s: list[float] = []  # how much later than its true time each pose is

    def _keep(self, poses: Array) -> None:
        self.ages_s += ((self.clock.now_ns() - poses["t_ns"]) * 1e-9).tolist()
        self.late_s += ((poses["t_ns"] - T0_NS) * 1e-9 - (poses["x"] - 1.0) * 1e3).tolist()

    def set_clock(self) -> None:
        self.clock.t_ns = T0_NS + round((self.t_s + self.host_s) * S)

    def restart(self, host_s: float, down_s: float = 5.0) -> None:
        """Kill the service, and start it on a host whose clock is then wrong by this much."""
        state = self.bench.service_state()
        snapshot = state.snapshot()
        self.t_s += down_s
        self._start(host_s)
        after = self.bench.service_state()
        after.restore(snapshot)
        self.clock.go_on_from(int(snapshot.arrays["counts"]["last_heard_ns"].max(initial=0)))
        self.bench.ingest.turn()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            for tag in range(len(self.errors_s)):
                self.send(tag, frame(self.t_s, self.errors_s[tag], self.numbers[tag], tag + 1))
            self.pass_time(STEP_S)

    def pass_time(self, seconds: float) -> None:
        self.t_s += seconds
        self.set_clock()

    def send(self, tag: int, message: Frame) -> None:
        self.numbers[tag] += 1
        self.bench.put(f"tag-{tag}", message, at_ns=self.clock.now_ns())
        self.bench.ingest.turn()

    def tag(self, number: int) -> Tag:
        found = self.bench.tags.find(f"tag-{number}")
        assert found is not None
        return found

    def errors(self) -> dict[int, float]:
        """Return the errors of clocks that are named, by number of the tag."""
        rows = {self.tag(number).row: number for number in range(len(self.errors_s))}
        return {rows[row]: error_s for row, error_s in self.bench.sites.rows.clock_errors.items()}

    def are_live(self) -> bool:
        """Return whether the last poses of all tags are of now, and none ever was of the future."""
        poses = self.bench.latest.since()[1]
        ages_s = (self.clock.now_ns() - poses["t_ns"]) * 1e-9
        return len(poses) == len(self.errors_s) and max(abs(ages_s)) < 1.0 and min(self.ages_s) > -NOISE_S


HOST = [5 * HOUR_S, DAY_S, -3 * HOUR_S]


@pytest.mark.parametrize("host_s", HOST)
def test_a_host_that_restarts_with_a_wrong_clock_is_named_once_and_poses_keep_their_times(
    host_s: float, caplog: pytest.LogCaptureFixture
) -> None:
    world = World([0.0, 0.1, -0.1])
    world.run(20.0)
    with caplog.at_level(logging.WARNING):
        world.restart(host_s)
        world.run(FOUND_S)
    assert world.are_live()
    assert max(map(abs, world.late_s)) < 0.2
    assert world.clock.problem is not None
    assert "the clock of this machine is" in world.clock.problem
    [metric] = world.bench.metrics.host_clock.collect()
    assert metric.samples[0].value == pytest.approx(host_s, abs=NOISE_S)
    assert world.errors() == {}
    assert [record.message for record in caplog.records if "clock of this machine" in record.message] == (
        [world.clock.problem] if host_s > 0 else []
    )
    assert world.bench.rejected() == {}
    world.restart(0.0)
    world.run(FOUND_S)
    assert world.are_live()
    assert max(map(abs, world.late_s)) < 0.2
    assert world.clock.problem is None


@pytest.mark.parametrize("host_s", HOST)
def test_a_new_service_on_such_a_host_goes_on_with_the_time_of_its_tags(host_s: float) -> None:
    world = World([0.0, 0.1, -0.1], host_s)
    world.run(FOUND_S)
    world.late_s.clear()
    world.run(5.0)
    assert max(map(abs, world.late_s)) < 0.2
    assert abs(world.clock.correction_ns * 1e-9 + host_s) < 0.5
    assert world.errors() == {}


@pytest.mark.parametrize("host_s", HOST)
def test_with_a_single_tag_the_two_clocks_are_told_apart_once_the_host_is_right_again(host_s: float) -> None:
    world = World([0.0])
    for then_s in (0.0, host_s, 0.0):
        world.restart(then_s)
        world.run(FOUND_S)
        world.late_s.clear()
        world.run(1.0)
        assert abs(world.clock.now_ns() - int(world.bench.latest.since()[1]["t_ns"][0])) < S
        assert bool(world.errors()) != (world.clock.problem is not None) or then_s == 0.0
    assert min(world.ages_s) > -NOISE_S
    assert max(map(abs, world.late_s)) < 0.2
    assert world.errors() == {}
    assert world.clock.problem is None


BEHIND = [60.0, HOUR_S, 30 * DAY_S]


@pytest.mark.parametrize("others", [[], [0.0], [0.0, 0.3]])
@pytest.mark.parametrize("behind_s", BEHIND)
def test_a_clock_that_is_behind_from_its_first_message_is_corrected_and_named(
    behind_s: float, others: list[float]
) -> None:
    world = World([-behind_s, *others])
    world.run(FOUND_S)
    assert world.are_live()
    assert world.errors() == {0: pytest.approx(-behind_s, abs=0.3)}
    assert world.clock.problem is None
    assert world.bench.rejected() == {}
    world.restart(0.0)
    world.late_s.clear()
    world.run(6.0)
    assert world.are_live()
    assert max(map(abs, world.late_s)) < 0.4
    tag = world.tag(0)
    [care] = care_of(tag, world.bench.health, world.clock.now_ns())
    assert care["reason"] == "clock_wrong"
    assert "the service corrects this" in care["hint"]


@pytest.mark.parametrize("error_s", [-60.0, -30 * DAY_S, HOUR_S])
def test_a_wrong_clock_that_is_set_right_is_no_longer_named(error_s: float) -> None:
    world = World([error_s, 0.0])
    world.run(FOUND_S)
    world.errors_s = [0.0, 0.0]
    world.late_s.clear()
    world.run(6.0)
    assert world.are_live()
    assert max(map(abs, world.late_s)) < 0.2
    assert world.errors() == {}


def test_a_tag_that_restarts_with_the_same_wrong_clock_goes_on_at_once() -> None:
    world = World([-HOUR_S, 0.0])
    world.run(FOUND_S)
    world.late_s.clear()
    for number in range(10):
        world.send(0, frame(world.t_s, -HOUR_S, number, boot_id=77))
        world.pass_time(STEP_S)
    assert max(map(abs, world.late_s)) < 0.4


def test_two_of_five_tags_that_agree_on_a_wrong_time_do_not_move_the_clock() -> None:
    world = World([HOUR_S, HOUR_S, 0.0, 0.1, 0.2])
    world.run(FOUND_S)
    assert world.clock.correction_ns == 0
    assert world.errors().keys() == {0, 1}


def bursts(dice: Random, backlog: int) -> Iterator[tuple[int, bool]]:
    """Yield how many messages of a backlog a device sends next, and whether it sends a live one then."""
    while backlog > 0:
        size = min(backlog, dice.choice((1, 5, 20, 100)))
        backlog -= size
        yield size, dice.random() < 0.6


@pytest.mark.parametrize("seed", range(4))
def test_an_hour_of_backlog_in_bursts_keeps_its_times_and_ends_live(seed: int) -> None:
    world, dice = World([0.0, 0.0]), Random(seed)
    world.run(20.0)
    begun_s, boot_id = world.t_s, seed % 2  # without a boot id, its messages are not numbered
    world.pass_time(HOUR_S)
    sent = 0
    for size, and_live in bursts(dice, round(HOUR_S / BATCH_S)):
        for _ in range(size):
            sent += 1
            world.send(0, frame(begun_s + sent * BATCH_S, 0.0, world.numbers[0], boot_id))
            world.pass_time(dice.choice((0.0, 0.002, 0.02)))
        if and_live:
            world.send(0, frame(world.t_s, 0.0, world.numbers[0], boot_id))
        world.pass_time(dice.choice((0.05, 0.2, 1.0)))
    assert max(map(abs, world.late_s)) < 0.2
    world.run(20.0)
    assert world.are_live()
    assert max(map(abs, world.late_s)) < 0.2
    assert world.errors() == {}
    assert world.clock.problem is None


def test_a_backlog_that_comes_back_at_the_pace_of_its_times_is_believed_again_once_it_shrinks() -> None:
    world = World([0.0, 0.0])
    world.run(5.0)
    behind_s = 300.0
    begun_s = world.t_s
    world.pass_time(behind_s)
    for number in range(round(2 * behind_s / STEP_S)):
        faster = 1.0 if number * STEP_S < 30.0 else 1.5
        world.send(0, frame(begun_s + number * STEP_S, 0.0, world.numbers[0], 1))
        world.pass_time(STEP_S / faster)
        if begun_s + number * STEP_S >= world.t_s - 1.0:
            break
    world.run(5.0)
    assert world.are_live()
    assert world.errors() == {}
