"""The attitude filter against known rotations."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_service.estimation.paper import attitude
from dropanchor_service.estimation.paper.attitude import (
    STANDARD_GRAVITY,
    AttitudeFilter,
    AttitudeParameters,
    Quaternion,
    Vector,
)

DT = 0.01
NO_FIELD: Vector = (math.nan, math.nan, math.nan)
FIELD: Vector = (0.0, 20.0, -44.0)  # µT in ENU: north and down
STILL: Vector = (0.0, 0.0, 0.0)
UP: Vector = (0.0, 0.0, STANDARD_GRAVITY)
VECTORS = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)).filter(lambda v: math.hypot(*v) > 0.1)
ANGLES = st.floats(-math.pi, math.pi)


def in_body(q: Quaternion, v: Vector) -> Vector:
    return attitude.rotate((q[0], -q[1], -q[2], -q[3]), v)


def pose_of(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> Quaternion:
    q = attitude.multiply(attitude.about_up(yaw), (math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0))
    return attitude.multiply(q, (math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0))


def angle_between(p: Quaternion, q: Quaternion) -> float:
    return 2 * math.acos(min(1.0, abs(sum(a * b for a, b in zip(p, q, strict=True)))))


def settled(parameters: AttitudeParameters | None = None, **start: float) -> AttitudeFilter:
    return AttitudeFilter(parameters or AttitudeParameters(), **start)


@given(v=VECTORS)
def test_the_quaternion_of_gravity_turns_it_up(v: Vector) -> None:
    n = math.hypot(*v)
    q = attitude.up_from((v[0] / n, v[1] / n, v[2] / n))
    assert math.hypot(*q) == pytest.approx(1.0)
    assert attitude.rotate(q, v) == pytest.approx((0, 0, n), abs=1e-9)


@pytest.mark.parametrize("z", [1.0, -1.0])
def test_gravity_straight_up_or_down_needs_no_division_by_zero(z: float) -> None:
    assert attitude.rotate(attitude.up_from((0.0, 0.0, z)), (0.0, 0.0, z)) == pytest.approx((0, 0, 1))


@given(v=VECTORS, gain=st.floats(0, 1))
def test_a_share_of_a_rotation_turns_about_the_same_axis_by_less(v: Vector, gain: float) -> None:
    whole = attitude.rotation_by(v)
    share = attitude.part_of(whole, gain)
    assert math.hypot(*share) == pytest.approx(1.0)
    turned = angle_between(share, attitude.IDENTITY)
    assert turned == pytest.approx(gain * math.hypot(*v), rel=0.05, abs=1e-6)  # LERP is near, not equal, to SLERP


@given(yaw=ANGLES, pitch=st.floats(-1.4, 1.4), roll=ANGLES)
def test_one_sample_of_gravity_and_field_gives_the_attitude(yaw: float, pitch: float, roll: float) -> None:
    truth = pose_of(yaw, pitch, roll)
    filter_ = settled()
    filter_.step(0.0, in_body(truth, UP), STILL, in_body(truth, FIELD))
    assert filter_.q is not None
    assert angle_between(filter_.q, truth) < 1e-6
    assert filter_.absolute


@pytest.mark.parametrize("declination", [-0.3, 0.2])
def test_declination_turns_magnetic_into_true_north(declination: float) -> None:
    """With a declination of +0.2 rad, magnetic north lies 0.2 rad east of true north."""
    filter_ = settled(declination=declination)
    filter_.step(0.0, UP, STILL, (20.0, 0.0, -44.0))  # the body looks to magnetic north
    assert filter_.yaw == pytest.approx(math.pi / 2 - declination)


@pytest.mark.parametrize("rate", [0.7, -0.7])
@pytest.mark.parametrize("magnetometer", [True, False], ids=["9-axis", "6-axis"])
def test_three_turns_on_the_spot_are_followed_across_pi(rate: float, magnetometer: bool) -> None:
    filter_ = settled(yaw_start=0.5)
    for i in range(round(3 * math.tau / abs(rate) / DT)):
        yaw = 0.5 + rate * DT * i
        field = in_body(pose_of(yaw), FIELD) if magnetometer else NO_FIELD
        filter_.step(DT, UP, (0.0, 0.0, rate), field)
        assert abs(math.remainder(filter_.yaw - yaw, math.tau)) < 1e-3


def test_a_rolling_and_pitching_body_is_followed_without_a_magnetometer() -> None:
    truth, filter_ = pose_of(0.3), settled(yaw_start=0.3)
    for i in range(3000):
        rate = (0.8 * math.sin(i * 0.02), 0.6 * math.cos(i * 0.013), 0.3)
        filter_.step(DT, in_body(truth, UP), rate, NO_FIELD)
        assert filter_.q is not None
        assert angle_between(filter_.q, truth) < 0.02
        next_rate = (0.8 * math.sin((i + 1) * 0.02), 0.6 * math.cos((i + 1) * 0.013), 0.3)
        turned = (next_rate[0] * DT, next_rate[1] * DT, next_rate[2] * DT)
        truth = attitude.multiply(truth, attitude.rotation_by(turned))


def test_a_wrong_tilt_decays_with_the_time_constant() -> None:
    filter_ = settled(AttitudeParameters(tilt_time=2.0))
    filter_.step(0.0, UP, STILL, NO_FIELD)
    tilted = in_body(pose_of(0.0, 0.4), UP)
    for _ in range(200):  # 2 s
        filter_.step(DT, tilted, STILL, NO_FIELD)
    assert filter_.q is not None
    assert angle_between(filter_.q, pose_of(0.0, 0.4)) == pytest.approx(0.4 * math.exp(-1), rel=0.03)


def test_hard_acceleration_does_not_tilt_the_horizon() -> None:
    filter_ = settled()
    filter_.step(0.0, UP, STILL, NO_FIELD)
    for _ in range(300):
        filter_.step(DT, (7.0, 0.0, STANDARD_GRAVITY), STILL, NO_FIELD)
    assert filter_.q == pytest.approx(attitude.IDENTITY, abs=1e-9)


def test_the_rest_at_switch_on_teaches_the_bias_of_the_gyroscope() -> None:
    rng = np.random.default_rng(1)
    filter_ = settled(yaw_start=0.0)
    bias = np.array([0.02, -0.01, 0.03])
    for _ in range(1500):
        filter_.step(DT, UP, tuple(bias + rng.normal(0, 0.005, 3)), NO_FIELD)
    assert filter_.bias == pytest.approx(tuple(bias), abs=3e-3)
    assert filter_.up_rate((0.02, -0.01, 0.53)) == pytest.approx(0.5, abs=0.01)


def test_a_turn_that_begins_is_not_learnt_as_a_bias() -> None:
    filter_ = settled(yaw_start=0.0)
    for i in range(100):
        filter_.step(DT, UP, (0.0, 0.0, 0.004 * i), NO_FIELD)
    assert filter_.bias == STILL


def test_a_sample_without_a_field_keeps_the_yaw_that_earlier_fields_gave() -> None:
    filter_ = settled()
    filter_.step(0.0, UP, STILL, in_body(pose_of(2.0), FIELD))
    for _ in range(300):
        filter_.step(DT, UP, STILL, NO_FIELD)
    assert filter_.yaw == pytest.approx(2.0)
    assert filter_.absolute


def test_the_first_field_sets_the_yaw_even_when_it_comes_late() -> None:
    filter_ = settled()
    filter_.step(0.0, UP, STILL, NO_FIELD)
    assert not filter_.absolute
    filter_.step(DT, UP, STILL, in_body(pose_of(-2.0), FIELD))
    assert filter_.yaw == pytest.approx(-2.0)
    assert filter_.absolute


def test_an_infinite_time_constant_leaves_the_magnetometer_out() -> None:
    filter_ = settled(AttitudeParameters(yaw_time=math.inf), yaw_start=0.4)
    for _ in range(100):
        filter_.step(DT, UP, STILL, in_body(pose_of(2.0), FIELD))
    assert filter_.yaw == pytest.approx(0.4)


@pytest.mark.parametrize(
    "acc", [STILL, (1e-9, 0.0, 0.0), (math.nan, 0.0, 9.8), (math.inf, 0.0, 0.0), (1e200, 1e200, 0.0)]
)
@pytest.mark.parametrize("mag", [NO_FIELD, STILL, (math.inf, 0.0, 0.0), (1e200, 1e200, 0.0), (0.0, 0.0, -40.0)])
def test_no_invalid_acceleration_or_field_harms_the_attitude(acc: Vector, mag: Vector) -> None:
    filter_ = settled()
    filter_.step(0.0, acc, STILL, mag)
    filter_.step(DT, UP, STILL, in_body(pose_of(1.0), FIELD))
    for _ in range(10):
        filter_.step(DT, acc, STILL, mag)
    assert filter_.yaw == pytest.approx(1.0)


def test_after_a_long_gap_a_6_axis_yaw_is_no_longer_known() -> None:
    filter_ = settled(yaw_start=0.0)
    filter_.step(0.0, UP, STILL, NO_FIELD)
    assert filter_.absolute
    filter_.step(5.0, UP, (0.0, 0.0, 1.0), NO_FIELD)
    assert not filter_.absolute


def test_after_a_long_gap_a_9_axis_yaw_comes_from_the_field_at_once() -> None:
    filter_ = settled()
    filter_.step(0.0, UP, STILL, in_body(pose_of(1.0), FIELD))
    filter_.step(5.0, UP, STILL, in_body(pose_of(-2.0), FIELD))
    assert filter_.yaw == pytest.approx(-2.0)
