"""Nodes against a fine, independent integration, and the growth of their variances."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dropanchor_service.estimation.fleet.frontend.node import NO_HEADING, RELATIVE_HEADING
from support.frontend import new_frontend, run
from support.imu import Motion, synthesise, turning, wrapped

Array = NDArray[Any]


def weaving(t: Array) -> Array:
    """Return the acceleration in ENU, m/s²."""
    return np.stack([0.8 * np.cos(1.1 * t), 0.6 * np.sin(1.7 * t), 0.3 * np.sin(2.3 * t)], axis=1)


def six_axis(seconds: float, dt: float = 0.01) -> Motion:
    m = synthesise(np.arange(0, seconds, dt), lambda t: turning(t, 0.6, 0.05), weaving)
    m.mag[:] = np.nan
    return m


def velocity_change(t0: Array, t1: Array) -> Array:
    """Return the exact integral of `weaving`, (n, 2) m/s in ENU."""

    def v(t: Array) -> Array:
        return np.stack([0.8 / 1.1 * np.sin(1.1 * t), -0.6 / 1.7 * np.cos(1.7 * t)], axis=1)

    return v(t1) - v(t0)


def test_yaw_increments_are_those_of_the_truth_between_samples_too() -> None:
    m = six_axis(40)
    ends = np.cumsum(np.random.default_rng(1).uniform(0.02, 0.1, 500))
    nodes = run(new_frontend(), m, ends)
    yaw = np.interp(ends, m.t, np.unwrap(m.yaw))
    assert abs(nodes["dyaw"][1:] - np.diff(yaw)).max() < 2e-3
    assert abs(np.cumsum(nodes["dyaw"])[1:] - (yaw[1:] - m.yaw[0])).max() < math.radians(0.5)


def test_velocity_increments_are_gravity_free_and_in_the_body_yaw_frame_at_the_start() -> None:
    m = six_axis(40)
    ends = np.arange(0.1, 39.9, 0.1)
    nodes = run(new_frontend(), m, ends)
    start = np.interp(ends - 0.1, m.t, np.unwrap(m.yaw))
    dv = velocity_change(ends - 0.1, ends)
    forward = np.cos(start) * dv[:, 0] + np.sin(start) * dv[:, 1]
    left = np.cos(start) * dv[:, 1] - np.sin(start) * dv[:, 0]
    settled = ends > 20  # the tilt correction takes accelerations for gravity at first
    assert abs(nodes["dv_forward"] - forward)[settled].max() < 0.03
    assert abs(nodes["dv_left"] - left)[settled].max() < 0.03
    assert np.corrcoef(nodes["dv_forward"][settled], forward[settled])[0, 1] > 0.98


def test_cutting_a_node_in_two_changes_nothing_in_the_sum() -> None:
    m = six_axis(20)
    coarse = np.arange(0.1, 19.9, 0.1)
    fine = np.sort(np.concatenate([coarse, coarse[:-1] + 0.037]))
    a, b = run(new_frontend(), m, coarse), run(new_frontend(), m, fine)
    assert np.sum(b["dyaw"]) == pytest.approx(np.sum(a["dyaw"]), abs=1e-9)
    assert np.sum(b["dyaw_var"]) < 1.01 * np.sum(a["dyaw_var"])
    assert b["heading"][-1] == a["heading"][-1]


def test_six_percent_of_accelerometer_scale_leaves_the_velocity_as_it_is() -> None:
    m, high = six_axis(30), six_axis(30)
    high.acc *= 1.06
    ends = np.arange(0.1, 29.9, 0.1)
    a, b = run(new_frontend(), m, ends), run(new_frontend(), high, ends)
    np.testing.assert_allclose(a["dv_forward"][50:], b["dv_forward"][50:], rtol=0, atol=2e-3)


def test_a_rough_ride_has_a_larger_velocity_variance_than_a_smooth_one() -> None:
    smooth, rough = six_axis(20), six_axis(20)
    rough.acc += np.random.default_rng(2).normal(0, 0.6, rough.acc.shape)
    ends = np.arange(0.1, 19.9, 0.1)
    a, b = run(new_frontend(), smooth, ends), run(new_frontend(), rough, ends)
    assert b["dv_var"][-1] > 3 * a["dv_var"][-1]


def shaken(directions: Array, std: float = 0.6) -> Array:
    """Return the nodes of a body that yaws while it shakes along these axes of its own, (k, 3), by `std` m/s^2."""
    m = synthesise(np.arange(0, 20, 0.01), lambda t: turning(t, 0.4, 0.1))
    m.acc += np.random.default_rng(4).normal(0, std, (len(m.t), len(directions))) @ directions
    return run(new_frontend(), m, np.arange(0.1, 19.9, 0.1))


def test_what_shakes_along_one_level_direction_is_motion_and_not_noise() -> None:
    along, round_about, upward = shaken(np.array([[0.8, 0.6, 0.0]])), shaken(np.eye(3)), shaken(np.eye(3)[2:])
    shares = [float(nodes["motion_var"][-1] / nodes["dv_var"][-1]) for nodes in (along, round_about, upward)]
    assert shares[0] > 0.85
    assert max(shares[1:]) < 0.15


def test_almost_all_of_what_shakes_along_one_level_direction_only_is_motion() -> None:
    nodes = shaken(np.array([[0.8, 0.6, 0.0]]), 5.0)
    assert nodes["motion_var"][-1] > 0.99 * nodes["dv_var"][-1]


def test_a_ramp_of_the_speed_is_no_roughness() -> None:
    def ramp(t: Array) -> Array:
        half_sine = np.where((t > 10) & (t < 10.5), 6.0 * np.sin(2.0 * math.pi * (t - 10)), 0.0)
        return np.stack([half_sine, 0 * t, 0 * t], axis=1)

    m = synthesise(np.arange(0, 14, 0.01), lambda t: np.zeros((len(t), 3)), ramp)
    ends = np.arange(0.1, 13.9, 0.1)
    nodes = run(new_frontend(), m, ends)
    assert nodes["dv_var"][ends > 10].max() < 5 * nodes["dv_var"][ends < 9.9].max()


def test_without_an_accelerometer_the_velocity_variance_is_infinite_and_yaw_goes_on() -> None:
    m = synthesise(np.arange(0, 20, 0.01), lambda t: turning(t, 0.6, 0.0))
    m.acc[:] = np.nan
    m.mag[:] = np.nan
    nodes = run(new_frontend(), m, ends := np.arange(0.1, 19.9, 0.1))
    assert np.isinf(nodes["dv_var"]).all()
    assert abs(wrapped(nodes["heading"] - 0.6 * ends)).max() < 1e-3
    assert not nodes["rest"].any()


@pytest.mark.parametrize("silence", [0.3, 3.0])
def test_a_silent_imu_makes_the_turn_uncertain_by_what_it_may_have_been(silence: float) -> None:
    m = six_axis(20)
    heard = (m.t < 10) | (m.t > 10 + silence)
    ends = np.arange(0.1, 19.9, 0.1)
    nodes = run(new_frontend(), m.at(heard), ends)
    truth = np.interp(ends, m.t, np.unwrap(m.yaw))
    e = wrapped(nodes["heading"] - truth + m.yaw[0])
    assert (nodes["heading_kind"] == RELATIVE_HEADING).all()
    assert abs(e / np.sqrt(nodes["heading_var"])).max() < 3
    inside = (ends > 10.15) & (ends < 10 + silence)
    assert nodes["dyaw_var"][inside].max() > 100 * nodes["dyaw_var"][ends < 9].max()


def test_before_the_first_sample_a_node_has_infinite_variances() -> None:
    m = six_axis(2)
    m.t += 1.0
    nodes = run(new_frontend(), m, np.array([0.3, 0.7]))
    assert nodes["dt_s"] == pytest.approx([0.0, 0.4])
    assert (nodes["heading_kind"] == NO_HEADING).all()
    assert np.isinf(nodes["dv_var"]).all()
    assert np.isinf(nodes["heading_var"]).all()
    assert nodes["dyaw_var"][1] > 0.05
