"""A phone posts its motion every second or so. The ranges, which come from elsewhere, wait for it and are used."""

from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import count, groupby
from typing import NamedTuple

import numpy as np
import pytest

from dropanchor_schemas.wire import Frame, decode_packed
from dropanchor_service.answers.answers import Answers
from dropanchor_service.answers.hints import FORWARD_UNKNOWN, RELATIVE_HINT
from dropanchor_service.answers.reason_hints import HINTS
from dropanchor_service.estimation.columns import ANCHOR, IMU, RANGE, Array, SampleBatch, StateReason, default_settings
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.fleet.frontend.sorting import MAX_WAITING
from dropanchor_tag_client.simulator.live import tag_name
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.traffic import T0_NS, known_starts, traffic

S = 1_000_000_000
SEED, SECONDS, PART = 9, 40.0, 50
TAG = tag_name(0)
NETWORK_NS = 60_000_000


class Arrival(NamedTuple):
    t_ns: int
    frame: Frame


def frame_of(payload: bytes) -> Frame:
    frame = decode_packed(payload)
    assert isinstance(frame, Frame)
    return frame


def posted(period_s: float, seconds: float = SECONDS) -> Iterator[Arrival]:
    """Yield ranges as they are measured, and the IMU samples of each period together at its end, in parts."""
    frames = [frame_of(message.payload) for message in traffic(1, seconds, SEED)]
    of_radio, of_phone = count(), count()
    ranges = [
        Arrival(r.t_ns + NETWORK_NS, Frame(ranges=[r], sequence=next(of_radio), boot_id=1))
        for frame in frames
        for r in frame.ranges
    ]
    samples = [sample for frame in frames for sample in frame.imu]
    batches = []
    for period, of_period in groupby(samples, lambda sample: (sample.t_ns - T0_NS) // round(period_s * S)):
        whole, end_ns = list(of_period), T0_NS + round((period + 1) * period_s * S)
        for part in (whole[i : i + PART] for i in range(0, len(whole), PART)):
            batches.append(Arrival(end_ns + NETWORK_NS, Frame(imu=part, sequence=next(of_phone), boot_id=2)))
    yield from sorted([*ranges, *batches], key=lambda arrival: arrival.t_ns)


class Phone:
    """A service that one tag sends to, which is looked at four times a second. known: whether its start is."""

    def __init__(self, known: bool = True, max_lag_s: float = 3.5) -> None:
        self.clock = ManualClock(T0_NS)
        tags = known_starts(1, SEED) if known else {}
        self.bench = IngestBench(engine=FleetEngine(max_lag_s=max_lag_s), clock=self.clock, tags=tags)
        self.answers = Answers(self.bench.site, self.bench.tags, self.bench.latest, now_ns=lambda: self.clock.t_ns)
        self.next_ns = T0_NS
        self.seen: list[tuple[float, str, str, float]] = []  # time, state, hint, age

    def run(self, arrivals: Iterable[Arrival]) -> "Phone":
        for arrival in arrivals:
            while self.next_ns <= arrival.t_ns:
                self.clock.t_ns, self.next_ns = self.next_ns, self.next_ns + S // 4
                self.look()
            self.clock.t_ns = arrival.t_ns
            self.bench.put(TAG, arrival.frame, at_ns=arrival.t_ns)
            self.bench.ingest.turn()
        return self

    def look(self) -> None:
        tag = self.bench.tags.find(TAG)
        pose = None if tag is None else self.answers.pose_of(tag)
        if pose is not None:
            self.seen.append(((self.clock.t_ns - T0_NS) / S, pose["state"], pose["hint"], pose["age_s"]))

    def states(self, since_s: float) -> Counter[str]:
        return Counter(state for t_s, state, _, _ in self.seen if t_s > since_s)

    def hints(self, since_s: float) -> set[str]:
        return {hint for t_s, _, hint, _ in self.seen if t_s > since_s}


@pytest.mark.parametrize("period_s", [1.0, 3.0])
@pytest.mark.parametrize("known", [True, False])
def test_a_phone_that_posts_every_few_seconds_has_poses_that_come_so_much_later(period_s: float, known: bool) -> None:
    phone = Phone(known).run(posted(period_s))
    since_s = 3 * period_s + 5.0
    assert phone.states(since_s).keys() <= {"tracking", "ambiguous"}
    assert phone.states(since_s)["tracking"] > 20
    tag = phone.bench.tags.find(TAG)
    assert tag is not None
    assert tag.used == tag.arrived
    assert tag.rejected == {}
    lag_s = float(phone.bench.tags.rows.lag_s(tag.row))
    assert period_s < lag_s < period_s + 0.4
    assert max(age_s for t_s, _, _, age_s in phone.seen if t_s > since_s) < lag_s
    lags = f"Its poses come up to {lag_s:.1f} s late, because its IMU samples come in batches"
    others = {HINTS[StateReason.SEVERAL_MODES], HINTS[StateReason.UNCERTAIN], FORWARD_UNKNOWN, RELATIVE_HINT}
    assert {hint for hint in phone.hints(since_s) if not hint.startswith(lags)} <= others


def test_a_tag_whose_motion_comes_in_time_waits_no_longer_than_usual() -> None:
    phone = Phone().run(posted(0.2))
    assert phone.bench.tags.rows.lag_s(0) == 0.0
    assert phone.hints(5.0) == {""}


def test_ranges_wait_no_longer_than_the_setting_allows() -> None:
    for max_lag_s in (0.25, 1.0):
        phone = Phone(max_lag_s=max_lag_s).run(posted(1.0, 12.0))
        assert phone.bench.tags.rows.lag_s(0) == 0.0


def test_the_wait_ends_a_while_after_the_batches_have_become_short() -> None:
    phone = Phone()
    phone.run(posted(1.0, 10.0))
    assert phone.bench.tags.rows.lag_s(0) > 1.0
    phone.run(renumbered(arrival for arrival in posted(0.2, 80.0) if newest_ns(arrival.frame) > T0_NS + 10 * S))
    assert phone.bench.tags.rows.lag_s(0) == 0.0
    assert phone.hints(75.0) == {""}


def test_one_late_batch_is_no_habit() -> None:
    late = (T0_NS + 10 * S, T0_NS + 12 * S)
    arrivals = [
        Arrival(late[1], arrival.frame) if arrival.frame.imu and late[0] < arrival.t_ns < late[1] else arrival
        for arrival in posted(0.2, 20.0)
    ]
    phone = Phone().run(iter(sorted(arrivals, key=lambda arrival: arrival.t_ns)))
    assert phone.bench.tags.rows.lag_s(0) == 0.0


def test_a_clock_of_the_motion_that_is_behind_makes_no_range_wait() -> None:
    behind = [
        arrival._replace(frame=arrival.frame.replaced(imu=[s._replace(t_ns=s.t_ns - 2 * S) for s in arrival.frame.imu]))
        for arrival in posted(0.2, 12.0)
    ]
    assert Phone().run(iter(behind)).bench.tags.rows.lag_s(0) == 0.0


def test_a_restart_keeps_how_long_ranges_wait() -> None:
    arrivals = list(posted(1.0, 14.0))
    whole, first = Phone().run(iter(arrivals)), Phone().run(iter(arrivals[:120]))
    rest = Phone()
    rest.bench.service_state().restore(first.bench.service_state().snapshot())
    rest.run(iter(arrivals[120:]))
    assert rest.bench.tags.rows.lag_s(0) == whole.bench.tags.rows.lag_s(0) > 1.0
    assert rest.bench.latest.since()[1].tobytes() == whole.bench.latest.since()[1].tobytes()


def test_a_row_keeps_no_more_than_so_many_ranges_waiting() -> None:
    fleet = FleetEngine()
    fleet.set_anchors(np.zeros(1, ANCHOR))
    fleet.configure(0, default_settings())
    fleet.process(SampleBatch(imu=imu_at(0)))
    ranges = np.zeros(3 * MAX_WAITING, RANGE)
    ranges["t_ns"], ranges["range"] = 100_000_000, 5.0  # one time: they are neither late nor has the IMU caught up
    assert len(fleet.process(SampleBatch(ranges=ranges)).poses) == 2 * MAX_WAITING
    assert len(fleet.state()["pending"]) == MAX_WAITING


def imu_at(t_ns: int) -> Array:
    imu = np.zeros(1, IMU)
    imu["t_ns"], imu["acc"], imu["mag"] = t_ns, (0.0, 0.0, 9.81), np.nan
    return imu


def newest_ns(frame: Frame) -> int:
    return max(*(sample.t_ns for sample in frame.imu), *(sample.t_ns for sample in frame.ranges), 0)


def renumbered(arrivals: Iterable[Arrival]) -> Iterator[Arrival]:
    """Yield the arrivals as of programs that have started again."""
    numbers = {1: count(), 2: count()}
    for t_ns, frame in arrivals:
        publisher = frame.boot_id or 0
        yield Arrival(t_ns, frame.replaced(sequence=next(numbers[publisher]), boot_id=publisher + 2))
