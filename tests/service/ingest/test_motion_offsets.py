"""The offset between the clocks of motion and ranges shows from turns and stops, or not at all."""

from collections.abc import Iterator

import numpy as np
import pytest

from dropanchor_schemas.wire import Frame, ImuSample, RangeSample
from dropanchor_service.estimation.columns import IMU, RANGE, SampleBatch
from dropanchor_service.ingest.motion_offsets.agreement import MAX_DEVIATION_S, MIN_WINDOWS, agreed
from dropanchor_service.ingest.motion_offsets.bins import SIZE, Motion, TagBins
from dropanchor_service.ingest.motion_offsets.fit import Minimum, fit
from dropanchor_service.ingest.motion_offsets.watch import MAX_TAGS, MotionOffsets
from dropanchor_service.store.clock_offsets import ClockOffset, MotionOffset
from dropanchor_tag_client.simulator.live import simulation
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate
from dropanchor_tag_client.simulator.walking import simulate_walk
from support.ingest import IngestBench
from support.manual_clock import ManualClock

S = 1_000_000_000
T = 1_760_000_000 * S
EVERY_S = 0.5  # samples arrive
SENSORS = preset("real", imu_hz=50.0)


def yard(seed: int) -> Simulation:
    return simulation("yard", seed, seed % 4, SENSORS, 120.0)


def batches(
    motion: Simulation, ahead_s: float, ranges: Simulation | None = None, row: int = 0
) -> Iterator[SampleBatch]:
    """Yield the motion of one run, by a clock that is ahead, with the ranges of the same or another."""
    measured = (ranges or motion).ranges
    imu, distances = np.zeros(len(motion.imu.t_s), IMU), np.zeros(len(measured.t_s), RANGE)
    imu["row"] = distances["row"] = row
    imu["t_ns"] = T + np.round((motion.imu.t_s + ahead_s) * S).astype(np.int64)
    imu["acc"], imu["gyro"] = motion.imu.acc, motion.imu.gyro
    distances["t_ns"], distances["range"] = T + np.round(measured.t_s * S).astype(np.int64), measured.range_m
    for begin in np.arange(0.0, motion.imu.t_s[-1], EVERY_S):
        of_imu, of_ranges = ((t >= begin) & (t < begin + EVERY_S) for t in (motion.imu.t_s, measured.t_s))
        yield SampleBatch(imu[of_imu], distances[of_ranges])


def answers(motion: Simulation, ahead_s: float, ranges: Simulation | None = None) -> list[MotionOffset]:
    """Return all answers for the motion of one run, by a clock that is ahead, and the ranges of the same or another."""
    offsets = MotionOffsets()
    found: list[MotionOffset] = []
    offsets.watch({0: 0})
    for batch in batches(motion, ahead_s, ranges):
        offsets.add(batch)
        answer = offsets.offset(0)
        if answer is not None and answer not in found[-1:]:
            found.append(answer)
    return found


def share_right(runs: list[Simulation]) -> tuple[int, float]:
    """Return how many answers there are over runs with offsets from -1.5 to 1.5 s, and the share that is right."""
    right = []
    for index, run in enumerate(runs):
        ahead_s = -1.5 + 3.0 * index / (len(runs) - 1)
        right += [abs(answer.offset_s - ahead_s) <= answer.uncertainty_s for answer in answers(run, ahead_s)]
    return len(right), float(np.mean(right))


def test_offsets_from_drives_with_turns_and_stops_are_right_within_their_uncertainty() -> None:
    count, right = share_right([yard(7000 + index) for index in range(12)])
    assert count >= 30
    assert right >= 0.95


def test_offsets_from_walks_are_right_within_their_uncertainty() -> None:
    count, right = share_right([simulate_walk("pocket", 7000 + index) for index in range(12)])
    assert count >= 5
    assert right >= 0.95


@pytest.mark.parametrize("scenario", ["forklift", "OU", "RV", "L1"])
def test_a_motion_that_does_not_tell_gives_no_answer(scenario: str) -> None:
    assert [answers(simulate(scenario, seed, SENSORS), 0.5) for seed in range(7000, 7003)] == [[], [], []]


@pytest.mark.parametrize("ahead_s", [-5.0, 3.5])
def test_an_offset_beyond_the_lags_gives_no_answer(ahead_s: float) -> None:
    assert [answers(yard(seed), ahead_s) for seed in range(7000, 7004)] == [[], [], [], []]


def test_the_ranges_of_another_tag_give_no_answer() -> None:
    assert [answers(yard(seed), 0.0, yard(seed + 4)) for seed in range(7000, 7004)] == [[], [], [], []]


def test_ranges_with_many_zeros_neither_tell_an_offset_nor_raise() -> None:
    run = yard(7003)
    run.ranges.range_m[::7] = 0.0
    assert [abs(answer.offset_s) <= answer.uncertainty_s for answer in answers(run, 0.0)] == []
    assert fit(Motion(np.zeros(260), np.ones(260)), np.where(np.arange(200) % 2, 50.0, 0.0)) is None


def test_windows_that_are_few_or_contradict_each_other_give_no_answer() -> None:
    window = Minimum(0.8, 0.1)
    whole = agreed([window] * MIN_WINDOWS)
    assert whole is not None
    assert whole.offset_s == pytest.approx(0.8)
    assert agreed([window] * (MIN_WINDOWS - 1)) is None
    assert agreed([window] * MIN_WINDOWS + [None] * (MIN_WINDOWS + 1)) is None
    assert agreed([*[window] * MIN_WINDOWS, Minimum(0.8 + 2 * MAX_DEVIATION_S, 0.1)]) is None


def test_bins_hold_the_newest_samples_and_reject_those_that_are_older() -> None:
    bins, step = TagBins(), S // 10
    t_ns = T + step * np.arange(2 * SIZE)
    bins.add_ranges(t_ns, np.zeros(len(t_ns), np.int32), np.arange(2.0 * SIZE))
    bins.add_ranges(t_ns[:1], np.zeros(1, np.int32), np.array([99.0]))
    first = T // step
    assert np.isnan(bins.mean_ranges(first, first + SIZE)).all()
    assert bins.mean_ranges(first + SIZE, first + 2 * SIZE).tolist() == list(range(SIZE, 2 * SIZE))


def test_another_anchor_is_used_when_the_first_one_has_been_silent() -> None:
    bins, first = TagBins(), T * 10 // S
    for second, anchor in enumerate([3, 4, 4, 4, 4, 4, 4, 4, 4]):
        bins.add_ranges(np.array([T + second * S]), np.array([anchor], np.int32), np.array([float(second)]))
    means = bins.mean_ranges(first, first + 100)
    assert means[np.isfinite(means)].tolist() == [6.0, 7.0, 8.0]


def test_the_number_of_watched_tags_is_bounded_and_other_rows_are_ignored() -> None:
    offsets, run = MotionOffsets(), yard(7001)
    offsets.watch(dict.fromkeys(range(MAX_TAGS + 1), 0))
    for row in (MAX_TAGS - 1, MAX_TAGS, 3 * MAX_TAGS):
        for batch in batches(run, 0.5, row=row):
            offsets.add(batch)
    assert offsets.offset(MAX_TAGS - 1) is not None
    assert offsets.offset(MAX_TAGS) is offsets.offset(3 * MAX_TAGS) is None
    offsets.watch({})
    assert offsets.offset(MAX_TAGS - 1) is None


def messages(run: Simulation, delay_s: float) -> list[tuple[float, Frame]]:
    """Return when each message arrives, s, and the message: motion and ranges from two programs, every half second.

    delay_s: of the messages with ranges.
    """
    sent: list[tuple[float, Frame]] = []
    for number, begin in enumerate(np.arange(0.0, run.imu.t_s[-1], 0.5).tolist()):
        of_imu, of_ranges = ((t >= begin) & (t < begin + 0.5) for t in (run.imu.t_s, run.ranges.t_s))
        imu = [
            ImuSample(T + round(t * S), (acc[0], acc[1], acc[2]), (gyro[0], gyro[1], gyro[2]))
            for t, acc, gyro in zip(*(column[of_imu].tolist() for column in run.imu[:3]), strict=True)
        ]
        ranges = [
            RangeSample(T + round(t * S), 7, distance)
            for t, distance in zip(
                run.ranges.t_s[of_ranges].tolist(), run.ranges.range_m[of_ranges].tolist(), strict=True
            )
        ]
        sent.append((begin + 0.5, Frame(imu=imu, sequence=number, boot_id=1)))
        sent.append((begin + 0.5 + delay_s, Frame(ranges=ranges, sequence=number, boot_id=2)))
    return sorted(sent, key=lambda message: message[0])


def test_a_network_that_delays_the_ranges_does_not_look_like_a_wrong_clock_to_the_motion() -> None:
    clock = ManualClock(T)
    bench = IngestBench(clock=clock)
    for arrival_s, frame in messages(yard(7003), delay_s=1.0):
        clock.t_ns = T + round(arrival_s * S)
        bench.send("a", frame)
    offset = bench.publishers.clock_offset(0, clock.t_ns)
    assert offset is not None
    assert offset.from_motion is not None
    assert offset.offset_s == pytest.approx(1.0, abs=0.1)
    assert abs(offset.from_motion.offset_s) <= offset.from_motion.uncertainty_s
    assert offset.disagrees
    assert offset.answer()["from_motion"] == offset.from_motion._asdict()


def test_message_times_and_motion_contradict_each_other_beyond_both_uncertainties() -> None:
    assert not ClockOffset(0.8, 0.1).disagrees
    assert not ClockOffset(0.8, 0.1, MotionOffset(0.5, 0.25)).disagrees
    assert ClockOffset(0.8, 0.1, MotionOffset(0.4, 0.25)).disagrees
