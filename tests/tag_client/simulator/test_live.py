"""Live tags: endless motions within the yard, and matching samples in order of time."""

import math
import tracemalloc
from itertools import islice, takewhile

import numpy as np
import pytest

from dropanchor_schemas.wire import ImuSample, RangeSample
from dropanchor_tag_client.simulator.live import YARD, Delivery, deliveries, simulation, start_poses
from dropanchor_tag_client.simulator.noise import Stream, stream
from dropanchor_tag_client.simulator.perturbations import perturbed
from dropanchor_tag_client.simulator.sensors import PRESETS, SensorModels, noiseless, preset
from dropanchor_tag_client.simulator.trajectory import Start, Trajectory, joined
from dropanchor_tag_client.simulator.wander import HABITS, RADIUS_M, Wanderer, steer

T0 = 1_760_000_000_000_000_000


def wandering(habit: int, seconds: float, seed: int = 0, dt: float = 0.02) -> Trajectory:
    motions = Wanderer(HABITS[habit], stream(seed, Stream.MOTION, habit), dt).motions()
    motion = next(motions)
    parts = takewhile(lambda part: part.t[0] < seconds, motions)
    for part in parts:
        motion = joined(motion, part)
    return motion


def bundles_until(count: int, scenario: str, seconds: float, models: SensorModels, seed: int = 0) -> list[Delivery]:
    bundles = deliveries(count, scenario, seed, models, T0)
    return list(takewhile(lambda bundle: bundle.due_s <= seconds, bundles))


@pytest.mark.parametrize("habit", range(len(HABITS)))
def test_movers_stay_in_the_yard_clear_of_the_anchor_and_stop_sometimes(habit: int) -> None:
    motion = wandering(habit, 1800.0)
    assert motion.distance.min() > 0.7
    assert motion.distance.max() <= RADIUS_M
    stops = np.count_nonzero(np.diff((motion.v == 0.0).astype(int)) == 1)
    assert stops >= 3
    assert motion.travelled[-1] > 600.0
    assert np.diff(motion.t) == pytest.approx(0.02)


@pytest.mark.parametrize("habit", range(len(HABITS)))
def test_movers_move_gently(habit: int) -> None:
    motion = wandering(habit, 900.0, seed=3)
    assert motion.v.min() >= 0.0
    assert motion.v.max() <= HABITS[habit].speed[1]
    assert np.abs(np.diff(motion.v)).max() / 0.02 < 2.5
    assert np.abs(motion.v * motion.w).max() < 10.0
    steps = np.hypot(np.diff(motion.x), np.diff(motion.y))
    assert steps.max() <= HABITS[habit].speed[1] * 0.02 + 1e-9


def test_steering_ends_on_a_line_through_the_target() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        here = Start(rng.uniform(-20, 20), rng.uniform(-20, 20), rng.uniform(-math.pi, math.pi))
        target = (float(rng.uniform(-20, 20)), float(rng.uniform(-20, 20)))
        arc = steer(here, target, 2.0)
        if arc is None:
            assert math.dist((here.x, here.y), target) <= 4.0
            continue
        angle, radius, way = arc
        side = math.copysign(1.0, angle)
        leaving = here.course + angle
        x = here.x + side * radius * (math.sin(leaving) - math.sin(here.course)) + way * math.cos(leaving)
        y = here.y - side * radius * (math.cos(leaving) - math.cos(here.course)) + way * math.sin(leaving)
        assert (x, y) == pytest.approx(target, abs=1e-9)


def test_tags_begin_at_their_start_poses_and_rest_for_two_seconds() -> None:
    poses = start_poses(8, seed=4)
    bundles = bundles_until(8, YARD, 2.0, preset("none", range_hz=10.0), seed=4)
    for index, pose in enumerate(poses):
        ranges = [sample for bundle in bundles if bundle.tag == index for sample in bundle.ranges]
        imu = [sample for bundle in bundles if bundle.tag == index for sample in bundle.imu]
        assert len(ranges) == 20
        assert [sample.range_m for sample in ranges] == pytest.approx([math.hypot(pose.x, pose.y)] * 20)
        assert np.abs([sample.gyro for sample in imu]).max() == 0.0
        assert imu[0].t_ns == T0
        mag = imu[0].mag
        assert mag is not None
        assert math.remainder(math.pi / 2 - math.atan2(mag[1], mag[0]) - pose.heading_rad, math.tau) == pytest.approx(0)


def test_start_poses_are_apart_and_exist_for_every_scenario() -> None:
    poses = start_poses(8)
    assert len({(round(pose.x), round(pose.y)) for pose in poses}) == 8
    assert [(pose.x, pose.y) for pose in start_poses(2, 5, "S5")] == [(10.0, 0.0), (10.0, 0.0)]


def test_samples_come_in_order_of_time_and_without_gaps() -> None:
    bundles = bundles_until(3, YARD, 60.0, PRESETS["calibrated"])
    dues = [bundle.due_s for bundle in bundles]
    assert dues == sorted(dues)
    for index in range(3):
        imu = [sample.t_ns for bundle in bundles if bundle.tag == index for sample in bundle.imu]
        ranges = [sample.t_ns for bundle in bundles if bundle.tag == index for sample in bundle.ranges]
        assert np.diff(imu) == pytest.approx(1e7, abs=2)
        assert np.diff(ranges) == pytest.approx(1e8, abs=2)
        assert len(imu) == pytest.approx(6000, abs=6)
    for group in (
        [(b.due_s, s.t_ns) for b in bundles for s in b.imu],
        [(b.due_s, s.t_ns) for b in bundles for s in b.ranges],
    ):
        assert all(t_ns <= T0 + due_s * 1e9 + 1000 for due_s, t_ns in group)
    assert all(isinstance(s, ImuSample) for b in bundles for s in b.imu)
    assert all(isinstance(s, RangeSample) and s.std_m == 0.1 for b in bundles for s in b.ranges)


def test_live_samples_are_those_of_the_motion() -> None:
    """Compare ranges, gyro and accelerometer of perfect sensors with the recording of the same tag."""
    models = preset("none", range_hz=10.0)
    bundles = bundles_until(2, YARD, 45.0, models, seed=1)
    run = simulation(YARD, 1, 1, models, 45.0)
    ranges = [sample.range_m for bundle in bundles if bundle.tag == 1 for sample in bundle.ranges]
    imu = [sample for bundle in bundles if bundle.tag == 1 for sample in bundle.imu]
    n = len(imu)
    assert n > 4400
    assert run.ranges.range_m[: len(ranges)] == pytest.approx(ranges, abs=1e-6)
    assert run.imu.gyro[:n] == pytest.approx(np.array([sample.gyro for sample in imu]), abs=1e-6)
    assert run.imu.acc[:n] == pytest.approx(np.array([sample.acc for sample in imu]), abs=1e-6)
    assert run.truth.v.max() > 0.5


def test_the_same_seed_gives_the_same_samples_and_tags_differ() -> None:
    first, again = (bundles_until(2, YARD, 10.0, PRESETS["real"], seed=9) for _ in range(2))
    assert first == again
    one, other = ([s.range_m for b in first if b.tag == tag for s in b.ranges] for tag in (0, 1))
    assert one != other
    assert bundles_until(2, YARD, 10.0, PRESETS["real"], seed=10) != first


def test_a_scenario_with_an_end_begins_with_more_rest_and_ends() -> None:
    bundles = list(deliveries(2, "S5", 3, noiseless(), T0))
    assert {bundle.tag for bundle in bundles} == {0, 1}
    imu = [sample for bundle in bundles if bundle.tag == 0 for sample in bundle.imu]
    run = simulation("S5", 3, 0, noiseless(), None)
    assert len(imu) == len(run.imu.t_s) + 200
    assert run.imu.gyro == pytest.approx(np.array([sample.gyro for sample in imu[200:]]), abs=1e-6)


def test_a_duration_cuts_a_recording() -> None:
    assert simulation("S5", 3, 0, PRESETS["real"], 20.0).truth.t_s[-1] == pytest.approx(20.0)
    assert simulation(YARD, 3, 0, PRESETS["real"], 20.0).truth.t_s[-1] == pytest.approx(20.0)


@pytest.mark.parametrize("name", ["nlosburst", "outage5", "hcorr", "late15", "combo"])
def test_a_perturbation_that_needs_a_finite_scenario_is_an_error_in_the_yard(name: str) -> None:
    with pytest.raises(ValueError, match="need a scenario with an end"):
        deliveries(1, YARD, 0, perturbed(PRESETS["real"], name), T0)


def test_a_long_demonstration_needs_no_more_memory_than_a_short_one() -> None:
    bundles = deliveries(8, YARD, 0, preset("real", imu_hz=10.0), T0)
    for _ in islice(bundles, 10_000):
        pass
    tracemalloc.start()
    for _ in islice(bundles, 60_000):
        pass
    grown, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert grown < 5_000_000
