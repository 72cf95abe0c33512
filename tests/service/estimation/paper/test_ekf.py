"""The paper's extended Kalman filter."""

import math

import numpy as np
import pytest

from dropanchor_service.estimation.paper import ekf
from dropanchor_service.estimation.paper.ekf import PoseFilter

Q = np.array([0.01, 0.01, 0.02, 0.3, 0.2])


def test_the_range_on_the_anchor_itself_has_no_direction() -> None:
    assert not ekf.H_range(np.zeros(5), (0.0, 0.0, 0.0)).any()


def test_a_circle_driven_in_many_steps_or_in_few_ends_at_the_same_place() -> None:
    one_turn = [np.array([3.0, 0.0, math.pi / 2, 0.6, 0.2])] * 2
    for i, steps in enumerate((60, 2000)):
        for _ in range(steps):
            one_turn[i] = ekf.f(one_turn[i], math.tau / 0.2 / steps)
    np.testing.assert_allclose(one_turn[0][:2], one_turn[1][:2], atol=1e-9)
    np.testing.assert_allclose(one_turn[0][:2], [3.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("z", [-3.1, 3.1])
def test_headings_on_either_side_of_pi_are_near_each_other(z: float) -> None:
    pose = PoseFilter(np.array([5.0, 0.0, math.copysign(3.12, -z), 0.0, 0.0]), np.eye(5), Q)
    pose.update_heading(z, R=1.0)
    middle = math.remainder(
        math.copysign(3.12, -z) + math.remainder(z - math.copysign(3.12, -z), math.tau) / 2, math.tau
    )
    assert pose.x[2] == pytest.approx(middle)
    assert abs(pose.x[2]) > 3.09


def test_headings_that_cross_pi_while_turning_are_followed() -> None:
    pose = PoseFilter(np.array([5.0, 0.0, 2.8, 0.0, 0.5]), np.eye(5) * 0.1, Q)
    for i in range(1, 60):
        pose.advance(0.05)
        pose.update_heading(math.remainder(2.8 + 0.5 * 0.05 * i, math.tau), R=0.01)
    assert math.remainder(pose.x[2] - (2.8 + 0.5 * 0.05 * 59), math.tau) == pytest.approx(0.0, abs=0.02)
    assert pose.x[4] == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("z", [math.nan, math.inf, -math.inf, 1e300, 40.0])
def test_a_range_beyond_the_gate_leaves_the_belief_alone(z: float) -> None:
    pose = PoseFilter(np.array([5.0, 0.0, 0.0, 0.0, 0.0]), np.eye(5), Q)
    with np.errstate(all="ignore"):
        assert not pose.update_range(z, 0.04, (0.0, 0.0, 0.0), gate=5.0).fused
    assert pose.x.tolist() == [5.0, 0.0, 0.0, 0.0, 0.0]


def test_the_height_of_the_anchor_above_the_tag_is_part_of_the_range() -> None:
    assert ekf.h_range(np.array([4.0, 6.0, 0.0, 0.0, 0.0]), (1.0, 2.0, 12.0)) == pytest.approx(13.0)


def test_process_noise_grows_with_time_and_not_with_the_number_of_steps() -> None:
    one, many = (PoseFilter(np.zeros(5), np.zeros((5, 5)), Q) for _ in range(2))
    one.advance(1.0)
    for _ in range(100):
        many.advance(0.01)
    np.testing.assert_allclose(many.P[3, 3], one.P[3, 3])
    np.testing.assert_allclose(many.P[4, 4], one.P[4, 4])
