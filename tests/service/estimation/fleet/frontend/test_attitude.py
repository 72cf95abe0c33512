"""The compiled attitude filter against known rotations and the readable filter."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dropanchor_service.estimation.fleet.frontend.attitude import (
    BOUND,
    TAU,
    down_weight,
    rotate_by,
    update_tilt_cov,
    yaw_of,
)
from dropanchor_service.estimation.paper.attitude import AttitudeFilter, AttitudeParameters
from support.fleet_attitude import angle_between, attitude_of, rotations, wxyz
from support.imu import G0, synthesise, turning

Array = NDArray[Any]


def test_a_small_turn_is_the_exponential_map_on_both_sides_of_the_series_limit() -> None:
    for angle in (1e-9, 0.01, 0.39, 0.41, 1.0, 3.0):
        q = np.array([0.5, -0.5, 0.5, 0.5])
        vector = angle * np.array([0.6, -0.64, 0.48])
        expected = wxyz(rotations(q) * Rotation.from_rotvec(vector))
        rotate_by(q, *vector)
        assert abs(abs(q @ expected) - 1) < 1e-12


def test_perfect_samples_keep_the_attitude_over_many_turns_past_pi() -> None:
    m = synthesise(np.arange(0, 60, 0.01), turning)
    q, _ = attitude_of(m, wxyz(m.attitude[0]))
    assert angle_between(q, m.attitude).max() < math.radians(0.1)


def test_yaw_is_the_azimuth_of_the_body_x_axis_for_any_pitch_and_roll() -> None:
    angles = np.random.default_rng(1).uniform([-3.1, -1.4, -3.1], [3.1, 1.4, 3.1], (200, 3))
    for q, yaw in zip(wxyz(Rotation.from_euler("ZYX", angles)), angles[:, 0], strict=True):
        assert yaw_of(q) == pytest.approx(yaw, abs=1e-9)


def test_a_wrong_tilt_at_start_is_gone_within_a_second_because_the_gain_ramps() -> None:
    m = synthesise(np.arange(0, 2, 0.01), lambda t: np.zeros((len(t), 3)))
    q, _ = attitude_of(m, wxyz(Rotation.from_euler("ZYX", [0, 0.3, -0.4])))
    up = rotations(q[100]).apply([0.0, 0.0, 1.0])
    assert np.hypot(up[0], up[1]) < math.radians(1)


def test_the_weight_of_the_accelerometer_fades_between_ten_and_twenty_percent() -> None:
    assert [down_weight(d) for d in (0, 0.1, -0.15, 0.2, -3)] == pytest.approx([1, 1, 0.5, 0, 0])


def test_a_hard_push_does_not_tilt_the_attitude() -> None:
    def push(t: Array) -> Array:
        return np.stack([np.where((t > 20) & (t < 22), 8.0, 0.0), 0 * t, 0 * t], axis=1)

    m = synthesise(np.arange(0, 22, 0.01), lambda t: np.zeros((len(t), 3)), push)
    q, _ = attitude_of(m, np.array([1.0, 0, 0, 0]))
    assert angle_between(q, m.attitude).max() < math.radians(0.1)


@pytest.mark.parametrize("rest_until", [0.9, -1.0])
def test_a_second_at_rest_or_not_makes_the_first_push_one_of_motion(rest_until: float) -> None:
    def push(t: Array) -> Array:
        return np.stack([np.where(t > 1, 4.0, 0.0), 0 * t, 0 * t], axis=1)

    m = synthesise(np.arange(0, 1.5, 0.01), lambda t: np.zeros((len(t), 3)), push)
    q, _ = attitude_of(m, np.array([1.0, 0, 0, 0]), rest_until)
    assert angle_between(q, m.attitude).max() < math.radians(1)


def test_a_ramp_of_the_speed_right_after_switch_on_hardly_tilts_the_attitude() -> None:
    def ramp(t: Array) -> Array:
        return np.stack([np.where((t > 1.5) & (t < 2.5), 2.0, 0.0), 0 * t, 0 * t], axis=1)

    m = synthesise(np.arange(0, 3, 0.01), lambda t: np.zeros((len(t), 3)), ramp)
    q, _ = attitude_of(m, np.array([1.0, 0, 0, 0]))
    assert angle_between(q, m.attitude).max() < math.radians(1.2)


def test_the_centripetal_acceleration_of_a_fast_arc_bends_the_tilt_no_faster_than_the_bound() -> None:
    def arc(t: Array) -> Array:
        return np.stack([np.where(t > 3, 3.0, 0.0), 0 * t, 0 * t], axis=1)

    m = synthesise(np.arange(0, 6, 0.01), lambda t: np.zeros((len(t), 3)), arc)
    q, _ = attitude_of(m, np.array([1.0, 0, 0, 0]))
    assert angle_between(q, m.attitude).max() < 1.1 * BOUND * 3.0 / TAU


def test_a_hard_acceleration_does_not_change_the_size_of_gravity() -> None:
    def push(t: Array) -> Array:
        return np.stack([np.where(t > 3, 8.0, 0.0), 0 * t, 0 * t], axis=1)

    m = synthesise(np.arange(0, 6, 0.01), lambda t: np.zeros((len(t), 3)), push)
    _, row = attitude_of(m, np.array([1.0, 0, 0, 0]))
    assert row["gravity"] == pytest.approx(G0, rel=0.01)


def test_an_accelerometer_that_reads_six_percent_high_is_its_own_gravity() -> None:
    m = synthesise(np.arange(0, 60, 0.01), turning)
    m.acc *= 1.06
    q, row = attitude_of(m, wxyz(m.attitude[0]))
    assert angle_between(q, m.attitude).max() < math.radians(0.1)
    assert row["gravity"] == pytest.approx(1.06 * G0, rel=1e-3)


def test_tilt_teaches_the_gyroscope_bias_across_the_vertical() -> None:
    m = synthesise(np.arange(0, 300, 0.02), lambda t: np.zeros((len(t), 3)))
    m.gyro += [0.01, -0.006, 0.0]
    _, row = attitude_of(m, np.array([1.0, 0, 0, 0]))
    assert row["bias"] == pytest.approx([0.01, -0.006, 0.0], abs=5e-4)


def test_the_readable_filter_agrees_on_the_same_six_axis_samples() -> None:
    rng = np.random.default_rng(2)
    m = synthesise(np.arange(0, 40, 0.01), turning)
    m.gyro += rng.normal(0, 0.01, m.gyro.shape)
    m.acc += rng.normal(0, 0.1, m.acc.shape)
    readable = AttitudeFilter(AttitudeParameters(yaw_time=math.inf), yaw_start=0.0)
    theirs = []
    for acc, gyro in zip(m.acc.tolist(), m.gyro.tolist(), strict=True):
        readable.step(0.01, tuple(acc), tuple(gyro), (math.nan, math.nan, math.nan))
        theirs.append(readable.q)
    q, _ = attitude_of(m, np.array(theirs[0]))
    assert angle_between(q, rotations(np.array(theirs))).max() < math.radians(1.5)


def drifting(acc_std: float) -> tuple[Array, Array]:
    """Return tilt errors (n,) rad and learned biases (3,) after 40 s level with a gyroscope bias of 0.01 rad/s."""
    m = synthesise(np.arange(0, 40, 0.01), lambda t: np.zeros((len(t), 3)))
    m.gyro += [0.01, 0.0, 0.0]
    m.acc += np.random.default_rng(3).normal(0.0, acc_std, m.acc.shape)
    q, row = attitude_of(m, wxyz(m.attitude[0]), bias_std=0.01)
    return angle_between(q, m.attitude), row["bias"]


def test_an_unknown_bias_of_the_gyroscope_is_learned_on_a_smooth_ride_without_any_rest() -> None:
    errors, bias = drifting(0.05)
    assert errors[2000:].max() < 0.02  # 0.01 rad/s * TAU = 0.06 with the gains of a known bias
    assert bias == pytest.approx([0.01, 0.0, 0.0], abs=0.002)


def test_the_covariance_of_tilt_and_bias_is_that_of_their_errors() -> None:
    rng = np.random.default_rng(5)
    errors = []
    for _ in range(500):
        P = np.array([0.04, 0.0, 1e-4])
        tilt, bias = rng.normal(0, 0.2), rng.normal(0, 0.01)
        for _ in range(200):
            tilt += bias * 0.1
            P[:] = P[0] + 0.2 * P[1] + 0.01 * P[2], P[1] + 0.1 * P[2], P[2]
            k = 0.1 / 6.1
            ki = update_tilt_cov(P, 0.05, k, 1e-4, False)
            e = tilt + rng.normal(0, math.sqrt(0.05))
            tilt, bias = tilt - k * e, bias - ki * e
        errors.append([tilt, bias])
    found = np.mean(np.square(errors), axis=0)
    assert found == pytest.approx([P[0], P[2]], rel=0.15)
