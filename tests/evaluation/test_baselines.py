"""The simple filters that the engine is compared with on recordings."""

import math
from collections import Counter

import numpy as np
import pytest

from dropanchor_evaluation.baselines import STEP_M, corrected, stays, step_times, walks
from dropanchor_service.estimation.columns import IMU, RANGE, Array, SampleBatch
from dropanchor_service.offline.replay import NS_PER_S, Samples

GRAVITY, FIELD, DIP = 9.81, 48.0, 1.1
WALK_S, RATE_HZ, STEP_HZ = 30.0, 50.0, 2.0
ANCHOR = (-4.0, 3.0, 0.0)


def walk(course: float, tilt: float = 0.0, steps: bool = True) -> Samples:
    """Return what a tag measures that is carried along a course from (0, 0). tilt: rad, of its nose, upwards."""
    t = np.arange(0.0, WALK_S, 1.0 / RATE_HZ)
    imu: Array = np.zeros(len(t), IMU)
    imu["t_ns"] = t * NS_PER_S
    up = np.array([math.sin(tilt), 0.0, math.cos(tilt)])
    ahead, left = np.array([math.cos(tilt), 0.0, -math.sin(tilt)]), np.array([0.0, 1.0, 0.0])
    north = math.sin(course) * ahead + math.cos(course) * left
    bob = 3.0 * np.sin(2 * math.pi * STEP_HZ * t) if steps else np.zeros(len(t))
    imu["acc"] = (GRAVITY + bob)[:, None] * up
    imu["mag"] = FIELD * (math.cos(DIP) * north - math.sin(DIP) * up)
    ranges: Array = np.zeros(int(WALK_S * 10), RANGE)
    at = np.arange(len(ranges)) / 10.0
    gone = STEP_M * STEP_HZ * at if steps else np.zeros(len(at))
    ranges["t_ns"] = at * NS_PER_S
    ranges["range"] = np.hypot(gone * math.cos(course) - ANCHOR[0], gone * math.sin(course) - ANCHOR[1])
    return Samples(SampleBatch(imu=imu, ranges=ranges), Counter())


@pytest.mark.parametrize("course", [0.0, 2.0, -1.0])
@pytest.mark.parametrize("tilt", [0.0, 0.6])
def test_steps_along_a_compass_lead_to_where_a_walker_is(course: float, tilt: float) -> None:
    samples = walk(course, tilt)
    assert len(step_times(samples.batch.imu)) == pytest.approx(WALK_S * STEP_HZ, abs=1)
    track = walks(samples, (0.0, 0.0), ANCHOR)
    assert track is not None
    gone = STEP_M * STEP_HZ * track.t[-1]
    last = track.poses[-1]
    assert math.hypot(last["x"] - gone * math.cos(course), last["y"] - gone * math.sin(course)) < 1.0
    assert np.linalg.det(last["cov"][:2, :2]) > 0


def test_nobody_walks_without_steps_or_a_compass() -> None:
    assert walks(walk(0.0, steps=False), (0.0, 0.0), ANCHOR) is None
    blind = walk(0.0)
    blind.batch.imu["mag"] = np.nan
    assert walks(blind, (0.0, 0.0), ANCHOR) is None


def test_a_range_moves_a_place_along_its_line_of_sight() -> None:
    place, cov = corrected(np.array([3.0, 0.0]), np.eye(2), 4.0, (0.0, 0.0, 0.0))
    assert 3.8 < place[0] < 4.0
    assert place[1] == 0.0
    assert cov[0, 0] < 0.1
    assert cov[1, 1] == 1.0
    high, _ = corrected(np.array([3.0, 0.0]), np.eye(2), 5.0, (0.0, 0.0, 4.0))
    assert high[0] == pytest.approx(3.0)  # its height explains the range


def test_a_dot_that_never_moves_is_at_its_start() -> None:
    track = stays(walk(0.0), (1.0, 2.0))
    assert set(track.poses["x"]) == {1.0}
    assert set(track.poses["y"]) == {2.0}
