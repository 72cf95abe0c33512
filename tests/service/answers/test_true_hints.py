"""What a hint says of the samples of a tag is true: it looks at what arrived, and not only at what was used."""

import re
from collections.abc import Callable

import pytest

from dropanchor_schemas.wire import ENCODING_JSON, Frame, ImuSample, PressureSample, RangeSample, decode_packed
from dropanchor_service.answers.answers import Answers
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_tag_client.simulator.live import tag_name
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.traffic import T0_NS, known_starts, traffic

S = 1_000_000_000
SEED = 9
TAG = tag_name(0)
MISSING = ("No more ranges arrive", "No IMU samples have arrived", "Too few ranges", "There is no heading yet")
Fault = Callable[[Frame, float], Frame]
"""Takes what a sound tag would send at a time, s, and returns what it sends instead."""


class Watched:
    """A service that one tag sends to, and what people are told about that tag."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.bench = IngestBench(engine=FleetEngine(), clock=self.clock, tags=known_starts(1, SEED))
        self.answers = Answers(self.bench.site, self.bench.tags, self.bench.latest, now_ns=lambda: self.clock.t_ns)
        self.told: list[tuple[float, str, str]] = []  # time, state, hint

    def send(self, frame: Frame | bytes, t_ns: int, encoding: str = "") -> None:
        self.clock.t_ns = t_ns
        self.bench.put(TAG, frame, at_ns=t_ns, **({"encoding": encoding} if encoding else {}))
        self.bench.ingest.turn()
        self.look()

    def look(self) -> None:
        tag = self.bench.tags.find(TAG)
        pose = None if tag is None else self.answers.pose_of(tag)
        if pose is not None:
            self.told.append(((self.clock.t_ns - T0_NS) / S, pose["state"], pose["hint"]))

    def drive(self, seconds: float, fault: Fault) -> "Watched":
        for message in traffic(1, seconds, SEED):
            frame = decode_packed(message.payload)
            assert isinstance(frame, Frame)
            self.send(fault(frame, (message.due_ns - T0_NS) / S), message.due_ns)
        return self

    def hints(self, since_s: float, until_s: float = 1e9) -> set[str]:
        """Return the hints of this time, with N for every number."""
        told = {hint for t_s, _, hint in self.told if since_s <= t_s <= until_s}
        return {re.sub(r"\d+", "N", hint) for hint in told}


def imu_frame(frame: Frame, change: Callable[[ImuSample], ImuSample]) -> Frame:
    return frame.replaced(imu=[change(sample) for sample in frame.imu])


def range_frame(frame: Frame, change: Callable[[RangeSample], RangeSample]) -> Frame:
    return frame.replaced(ranges=[change(sample) for sample in frame.ranges])


def same_times(frame: Frame, _: float) -> Frame:
    return imu_frame(frame, lambda sample: sample._replace(t_ns=sample.t_ns - sample.t_ns % S))


def imu_ahead(frame: Frame, _: float) -> Frame:
    return imu_frame(frame, lambda sample: sample._replace(t_ns=sample.t_ns + 3_100_000_000))


def all_zero(frame: Frame, _: float) -> Frame:
    return range_frame(frame, lambda sample: sample._replace(range_m=0.0))


def frozen(frame: Frame, t_s: float) -> Frame:
    one = ((0.1, 0.2, 9.7), (0.01, 0.0, 0.0), None)
    return imu_frame(frame, lambda sample: ImuSample(sample.t_ns, *one)) if t_s > 5.0 else frame


def stuck_radio(frame: Frame, t_s: float) -> Frame:
    return range_frame(frame, lambda sample: sample._replace(range_m=9.25)) if t_s > 5.0 else frame


def in_millimetres(frame: Frame, _: float) -> Frame:
    return range_frame(frame, lambda sample: sample._replace(range_m=4000.0 + 1000.0 * sample.range_m))


def with_pressure(frame: Frame, value: float) -> Frame:
    return frame.replaced(pressures=[PressureSample(frame.times()[0], value)])


FAULTS: dict[str, tuple[Fault, str]] = {
    "same times": (same_times, "N of its last N IMU samples were not used: several have the same time"),
    "all zero": (all_zero, "Its last N ranges are all N: the radio measures no distance"),
    "frozen": (frozen, "N of its last N IMU samples were not used: they are equal to the last bit"),
    "stuck radio": (stuck_radio, "N of its last N ranges were not used: they are equal although the tag moves"),
    "hPa": (
        lambda frame, _: with_pressure(frame, 1_013.25),
        "N of its last N pressures were not used: they look like hPa, so multiply them by N",
    ),
    "kPa": (
        lambda frame, _: with_pressure(frame, 101.325),
        "N of its last N pressures were not used: they look like kPa, so multiply them by N",
    ),
    "inHg": (
        lambda frame, _: with_pressure(frame, 29.92),
        "N of its last N pressures were not used: no air has so low a pressure, so send Pa",
    ),
    "millimetres": (in_millimetres, "The ranges look like millimetres: divide them by N"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_no_hint_about_samples_that_arrive_and_are_not_used_is_untrue(name: str) -> None:
    fault, hint = FAULTS[name]
    watched = Watched().drive(15.0, fault)
    if watched.told:
        told = watched.hints(12.0)
        assert [text for text in told if not text.startswith(hint)] == []
        assert not any(text.startswith(MISSING) for text in watched.hints(1.0))
    tag = watched.bench.tags.find(TAG)
    assert tag is not None
    assert re.sub(r"\d+", "N", watched.answers.hint_of(tag)).startswith(hint) or name == "all zero"


def test_an_imu_whose_clock_is_ahead_is_used_and_no_hint_is_untrue() -> None:
    watched = Watched().drive(15.0, imu_ahead)
    tag = watched.bench.tags.find(TAG)
    assert tag is not None
    assert tag.used["range"] == tag.arrived["range"]
    assert watched.hints(5.0) == {""}


def test_a_hint_about_samples_that_were_not_used_goes_away_when_they_are_used_again() -> None:
    watched = Watched().drive(22.0, lambda frame, t_s: same_times(frame, t_s) if t_s < 8.0 else frame)
    assert all("the same time" in hint for hint in watched.hints(5.0, 8.0))
    assert not any("the same time" in hint for hint in watched.hints(19.0))


def test_messages_that_cannot_be_read_give_a_hint_although_the_tag_has_no_pose() -> None:
    watched = Watched()
    for i in range(6):
        watched.send(b'{"imu": 5}', T0_NS + i * S // 5, ENCODING_JSON)
    tag = watched.bench.tags.find(TAG)
    assert tag is not None
    assert re.match(r"\d of its last \d messages were not used: they are not JSON", watched.answers.hint_of(tag))
    watched.clock.t_ns += 20 * S
    assert watched.answers.hint_of(tag) == ""


def test_a_tag_that_never_had_a_position_is_not_lost_and_its_hint_says_what_it_needs() -> None:
    watched = Watched()
    watched.bench.site.remove_tag(TAG, T0_NS)  # its start
    first = decode_packed(traffic(1, 1.0, SEED)[0].payload)
    assert isinstance(first, Frame)
    watched.send(Frame(imu=first.imu[:1]), T0_NS)
    watched.send(Frame(ranges=first.ranges[:1]), T0_NS + S // 10)
    for later_ds in (1, 20, 21, 22, 150, 36_000):  # also while one of them has ended and the other has not
        watched.clock.t_ns = T0_NS + later_ds * S // 10
        watched.look()
    assert {state for _, state, _ in watched.told} == {"initialising"}
    hint = "A position needs about 20 s of ranges and of motion samples: 1 and 1 have arrived."
    assert {told for _, _, told in watched.told} == {hint}


def test_what_arrived_and_what_was_used_are_counted_by_kind() -> None:
    watched = Watched().drive(5.0, same_times)
    tag = watched.bench.tags.find(TAG)
    assert tag is not None
    assert tag.arrived == tag.samples
    assert tag.used["range"] == tag.arrived["range"]
    assert tag.arrived["imu"] - tag.used["imu"] == tag.rejected["time_repeated"] > 30
    absurd = Watched().drive(5.0, in_millimetres)
    tag = absurd.bench.tags.find(TAG)
    assert tag is not None
    assert (tag.arrived["range"], tag.used["range"]) == (tag.rejected["range_absurd"], 0)
