"""The sideways acceleration against finite differences, and what it teaches."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.columns import default_settings
from dropanchor_service.estimation.fleet.belief.layout import ACC_BIAS, GYRO_BIAS, LEFT_BIAS, MOUNT, SLIP, N, V
from dropanchor_service.estimation.fleet.configure import configure_row
from dropanchor_service.estimation.fleet.measurement.lateral import (
    is_lateral_known,
    lateral_residual,
    update_lateral,
)
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.belief import STATE, hypothesis_of, jacobian_fd, node_of


def driven(before: float, after: float, turn: float, mount: float) -> Any:
    """The node of a tag that travels along its course, from one speed to another, in the frame of its start."""
    return node_of(
        dyaw=turn,
        forward=after * math.cos(mount + turn) - before * math.cos(mount),
        left=after * math.sin(mount + turn) - before * math.sin(mount),
    )


def state_of(speed: float, mount: float) -> Any:
    s = STATE.copy()
    s[V], s[MOUNT], s[SLIP], s[GYRO_BIAS], s[ACC_BIAS], s[LEFT_BIAS] = speed, mount, 0.0, 0.0, 0.0, 0.0
    return s


@pytest.mark.parametrize("dyaw", [-0.4, 0.0, 0.06])
def test_the_jacobian_of_the_sideways_increment_equals_finite_differences(dyaw: float) -> None:
    node, H = node_of(dyaw=dyaw, forward=0.3, left=-0.2), np.zeros(N)
    lateral_residual(STATE, node, H)
    expected = jacobian_fd(lambda s: np.array([lateral_residual(s, node, np.zeros(N))]), STATE)[0]
    np.testing.assert_allclose(H, expected, atol=1e-7)


@pytest.mark.parametrize(
    ("before", "turn", "mount"), [(1.0, 0.0, 0.0), (1.0, 0.0, 0.4), (2.5, 0.5, 0.0), (2.5, -0.3, 0.7), (2.5, 0.2, -2.0)]
)
def test_nothing_is_left_of_a_ramp_or_a_turn_of_a_tag_that_follows_its_course(
    before: float, turn: float, mount: float
) -> None:
    node = driven(before, 2.5, turn, mount)
    assert lateral_residual(state_of(2.5, mount), node, np.zeros(N)) == pytest.approx(0.0, abs=1e-12)


def row_of() -> Any:
    rows = np.zeros(1, configure_row(default_settings(), Tuning()).dtype)
    rows[0] = configure_row(default_settings(), Tuning())
    return rows[0]


def unmounted() -> tuple[Any, Any]:
    """A hypothesis whose mounting angle is good to 0.5 rad, and its scratch."""
    P = np.diag(np.full(N, 1e-4))
    P[MOUNT, MOUNT], P[LEFT_BIAS, LEFT_BIAS] = 0.25, 0.04
    return hypothesis_of(state_of(0.0, 0.0), P)


def test_one_ramp_of_the_speed_teaches_the_mounting_angle() -> None:
    row, (one, scratch) = row_of(), unmounted()
    for k in range(10):
        one["mean"][V] = 0.3 * (k + 1)
        update_lateral(one, scratch, driven(0.3 * k, 0.3 * (k + 1), 0.0, 0.4), row, 0.1, 0.0)
    assert one["mean"][MOUNT] == pytest.approx(0.4, abs=0.1)
    assert one["cov"][MOUNT, MOUNT] < 0.02


@pytest.mark.parametrize(("roughness", "used"), [(0.002, True), (0.1, False), (math.inf, False)])
def test_a_rough_ride_says_nothing_sideways(roughness: float, used: bool) -> None:
    node = node_of(dt=0.1)
    node["dv_var"] = roughness * 0.1
    assert is_lateral_known(node) is used


@pytest.mark.parametrize(("motion", "used"), [(0.999, True), (0.9, False)])
def test_a_ride_that_is_rough_only_along_its_course_still_says_something_sideways(motion: float, used: bool) -> None:
    node = node_of(dt=0.1)
    node["dv_var"], node["motion_var"] = 0.1 * 0.5, 0.1 * 0.5 * motion
    assert is_lateral_known(node) is used


def test_a_tag_that_speeds_up_and_brakes_all_the_time_learns_its_mounting_angle() -> None:
    row, (one, scratch) = row_of(), unmounted()
    for k in range(20):
        before, after = (1.0, 1.2) if k % 2 else (1.2, 1.0)
        node = driven(before, after, 0.0, 0.4)
        node["dv_var"], node["motion_var"] = 0.1 * 0.5, 0.1 * 0.4995
        one["mean"][V] = after
        update_lateral(one, scratch, node, row, 0.02, 0.0)
    assert one["mean"][MOUNT] == pytest.approx(0.4, abs=0.05)
    assert one["cov"][MOUNT, MOUNT] < 0.02


def lost_weight(angle: float, power: float) -> float:
    """Return the log weight that a hypothesis with a mount of `angle` rad loses, where 0.4 rad is true, by one ramp."""
    row, (one, scratch) = row_of(), unmounted()
    one["mean"][MOUNT], one["cov"][MOUNT, MOUNT] = angle, 0.02
    for k in range(10):
        one["mean"][V] = 0.3 * (k + 1)
        update_lateral(one, scratch, driven(0.3 * k, 0.3 * (k + 1), 0.0, 0.4), row, 0.02, power)
    return -float(one["log_weight"])


def test_a_ramp_weighs_hypotheses_with_other_mounting_angles() -> None:
    right, wrong = lost_weight(0.4, 0.3), lost_weight(-0.6, 0.3)
    assert wrong > right + 3.0
    assert lost_weight(-0.6, 0.0) == 0.0


def weight_of(speed: float) -> float:
    """Return the log weight of a hypothesis after ten seconds straight on, in nodes of 10 ms."""
    row, (one, scratch) = row_of(), hypothesis_of(state_of(speed, 0.0), np.diag(np.full(N, 1e-6)))
    for _ in range(1000):
        update_lateral(one, scratch, node_of(dt=0.01, dyaw=0.0, forward=0.0, left=0.0), row, 0.02, 0.3)
    return float(one["log_weight"])


def test_a_straight_ride_makes_no_hypothesis_likelier_for_being_slow() -> None:
    assert weight_of(0.5) == pytest.approx(weight_of(3.0), abs=0.5)
