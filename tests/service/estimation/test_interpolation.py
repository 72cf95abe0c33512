"""Poses between two known ones, and shortly after the last one."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.columns import POSE, Array, State
from dropanchor_service.estimation.interpolation import bridged, interpolated, propagated


def pose(t_s: float = 0.0, **fields: Any) -> Array:
    made = np.zeros((), POSE)
    made["t_ns"], made["state"], made["cov"] = round(t_s * 1e9), State.TRACKING, np.diag([0.01, 0.01, 0.001])
    for name, value in fields.items():
        made[name] = value
    return made


def test_a_pose_is_carried_along_its_circle() -> None:
    later = propagated(pose(x=2.0, heading=math.pi / 2, speed=1.0, yaw_rate=0.5), 1_000_000_000)
    assert later["x"] == pytest.approx(2.0 * math.cos(0.5), abs=0.03)
    assert later["y"] == pytest.approx(2.0 * math.sin(0.5), abs=0.03)
    assert later["heading"] == pytest.approx(math.pi / 2 + 0.5)


def test_the_covariance_is_that_of_many_noisy_runs_and_grows_with_time() -> None:
    start = pose(heading=0.4, speed=1.5, yaw_rate=0.3)
    rng = np.random.default_rng(3)
    runs = []
    for x, y, heading in rng.multivariate_normal([0.0, 0.0, 0.4], start["cov"], 20_000):
        run = pose(x=x, y=y, heading=heading, speed=1.5 + 0.3 * rng.standard_normal(), yaw_rate=0.3)
        run["yaw_rate"] += 0.1 * rng.standard_normal()
        end = propagated(run, 500_000_000)
        runs.append([end["x"], end["y"], end["heading"]])
    later = propagated(start, 500_000_000)
    # what the runs leave out: the changes of speed and yaw rate on the way
    assert (later["cov"].diagonal() >= np.cov(np.array(runs).T).diagonal() * 0.97).all()
    assert later["cov"][1, 1] < 3 * np.cov(np.array(runs).T)[1, 1]
    sigmas = [float(propagated(start, t_ns)["sigma_pos"]) for t_ns in (0, 500_000_000, 1_000_000_000, 2_000_000_000)]
    assert sigmas == sorted(set(sigmas))


def test_between_two_poses_headings_turn_the_short_way_and_the_lesser_claim_counts() -> None:
    before = pose(0.0, x=0.0, heading=3.1, p_mode=0.99)
    after = pose(0.5, x=1.0, heading=-3.1, p_mode=0.6, state=State.AMBIGUOUS)
    middle = interpolated(before, after, 250_000_000)
    assert middle["x"] == pytest.approx(0.5)
    assert abs(middle["heading"]) == pytest.approx(math.pi)
    assert int(middle["state"]) == State.AMBIGUOUS
    assert float(middle["p_mode"]) == 0.6


def test_between_two_floors_the_height_is_as_uncertain_as_when_the_lift_leaves() -> None:
    before, after = pose(0.0, z=1.0, z_std=0.2), pose(2.0, z=5.0, z_std=0.3)
    middle = interpolated(before, after, 500_000_000)
    heights = np.repeat([1.0 - 0.2, 1.0 + 0.2, 5.0 - 0.3, 5.0 + 0.3], [3, 3, 1, 1])  # a quarter has left
    assert middle["z"] == pytest.approx(heights.mean())
    assert middle["z_std"] == pytest.approx(heights.std())


def test_a_bridge_is_as_uncertain_as_a_motion_of_constant_acceleration_over_its_gap() -> None:
    rng = np.random.default_rng(5)
    before, after = pose(0.0, cov=np.zeros((3, 3))), pose(4.0, x=8.0, cov=np.zeros((3, 3)))
    for share in (0.0, 0.25, 0.5, 1.0):
        t = 4.0 * share
        between = bridged(before, after, round(t * 1e9))
        assert between["x"] == pytest.approx(2.0 * t)
        # x(t) with acceleration a and the start speed that ends at the same place
        a = rng.standard_normal(50_000)
        x = (8.0 - a * 16.0 / 2) / 4.0 * t + a * t * t / 2
        assert between["cov"][0, 0] == pytest.approx(np.var(x), rel=0.05, abs=1e-12)
        assert between["sigma_pos"] == pytest.approx(math.sqrt(2 * between["cov"][0, 0]))


def test_the_heading_of_a_long_bridge_is_at_worst_unknown() -> None:
    between = bridged(pose(0.0), pose(10.0), 5_000_000_000)
    assert between["cov"][2, 2] == pytest.approx(0.001 + math.pi**2 / 3)
