"""The predicted error of the tilt: its Jacobian, and what the front-end really makes of an arc."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.fleet.belief.layout import ACC_BIAS, GYRO_BIAS, LEFT_BIAS, N, V
from dropanchor_service.estimation.fleet.belief.tilt import (
    TILTING_S,
    bends_tilt,
    predict_tilt,
    tilting_growth,
    widen_tilt,
)
from dropanchor_service.estimation.fleet.frontend.attitude import TAU
from dropanchor_service.estimation.fleet.frontend.preintegration import G0
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.belief import STATE, jacobian_fd, node_of
from support.frontend import new_frontend, run
from support.imu import Motion, synthesise

SPEED, RATE, STARTS, TURNS, SHARPLY = 2.0, 0.3, 4.0, 20.0, 20.5  # m/s, rad/s, s: an arc, then a right angle
ROLLING, VIBRATING = 4e-4, 8e-3  # (m/s)^2/s, roughness of the simulator's rollers and of its other vehicles


def yaw_rate_at(t: Any) -> Any:
    return np.select([t < STARTS, t < TURNS, t < SHARPLY], [0.0, RATE, math.pi], 0.0)


def ride(seconds: float = 24.0) -> Motion:
    """A level tag at a constant speed: straight on, an arc, a sharp turn, straight on."""
    t = np.arange(0.0, seconds, 0.01)
    edges = [(STARTS, TURNS, RATE), (TURNS, SHARPLY, math.pi)]

    def angles(at: Any) -> Any:
        yaw = sum(rate * np.clip(at - low, 0.0, high - low) for low, high, rate in edges)
        return np.column_stack([yaw, np.zeros_like(at), np.zeros_like(at)])

    def acceleration(at: Any) -> Any:
        yaw, across = angles(at)[:, 0], SPEED * yaw_rate_at(at)
        return np.column_stack([-np.sin(yaw) * across, np.cos(yaw) * across, np.zeros_like(at)])

    motion, rng = synthesise(t, angles, acceleration), np.random.default_rng(5)
    motion.acc += rng.normal(0.0, 0.2, motion.acc.shape)  # so that straight on is not taken for standstill
    motion.gyro += rng.normal(0.0, 0.01, motion.gyro.shape)
    return motion


def arc_nodes() -> Any:
    """The nodes of `ride` from the start of the arc on, 0.1 s each."""
    return run(new_frontend(), ride(), np.arange(0.1, 23.9, 0.1)).view(np.recarray)[40:]


def before(second: float) -> slice:
    """Which of these nodes lie in the second before this time."""
    return slice(round(10 * (second - STARTS - 1.0)), round(10 * (second - STARTS)))


def error_of(node: Any) -> tuple[float, float]:
    """Return the error of the accelerations along and across the course, m/s^2, at the constant speed of `ride`."""
    half = node.dyaw / 2
    along = node.dv_forward * math.cos(half) + node.dv_left * math.sin(half)
    across = node.dv_left * math.cos(half) - node.dv_forward * math.sin(half)
    return along / node.dt_s, (across - 2.0 * SPEED * math.sin(half)) / node.dt_s


def state_of() -> tuple[Any, Any]:
    """Return a state with the speed of `ride`, and a covariance of zero."""
    s, P = np.zeros(N), np.zeros((N, N))
    s[V] = SPEED
    return s, P


def test_the_biases_follow_what_an_arc_and_a_sharp_turn_do_to_the_tilt() -> None:
    """The mean error of a second of increments is predicted to more than a half; the rest is decay and noise."""
    s, P = state_of()
    wrong: list[Any] = []
    predicted: list[Any] = []
    for node in arc_nodes():
        assert bends_tilt(node, True)
        s[[ACC_BIAS, LEFT_BIAS]] *= math.exp(-node.dt_s / Tuning().acc_bias_tau)  # as `predict_state` does
        predict_tilt(s, P, node)
        wrong.append(error_of(node))
        predicted.append((s[ACC_BIAS], s[LEFT_BIAS]))
    for second in (14.0, 18.0, 21.5):  # in the arc twice, and after the sharp turn
        true, told = np.mean(wrong[before(second)], axis=0), np.mean(predicted[before(second)], axis=0)
        assert np.hypot(*true) > 0.2
        assert np.hypot(*(true - told)) < 0.5 * np.hypot(*true)


def braking_nodes() -> Any:
    """The nodes of a tag that starts at 2 m/s^2, drives on and backs off at 3 m/s^2, 0.1 s each."""
    t = np.arange(0.0, 10.5, 0.01)

    def acceleration(at: Any) -> Any:
        ahead = np.where((at >= 4.0) & (at < 5.5), 2.0, 0.0) - np.where((at >= 8.0) & (at < 9.5), 3.0, 0.0)
        return np.column_stack([ahead, np.zeros_like(at), np.zeros_like(at)])

    motion, rng = synthesise(t, lambda at: np.zeros((len(at), 3)), acceleration), np.random.default_rng(6)
    motion.acc += rng.normal(0.0, 0.2, motion.acc.shape)
    motion.gyro += rng.normal(0.0, 0.01, motion.gyro.shape)
    return run(new_frontend(), motion, np.arange(0.1, 10.4, 0.1)).view(np.recarray)


def test_the_forward_bias_follows_what_starting_and_backing_off_do_to_the_tilt() -> None:
    (s, P), nodes = state_of(), braking_nodes()
    told: list[float] = []
    for node in nodes:
        s[ACC_BIAS] *= math.exp(-node.dt_s / Tuning().acc_bias_tau)  # as `predict_state` does
        predict_tilt(s, P, node)
        told.append(s[ACC_BIAS])
    wrong = nodes.dv_forward / np.maximum(nodes.dt_s, 1e-3)  # where the speed is constant
    cruising, before_backing, backing = slice(58, 66), slice(70, 78), slice(96, None)
    assert np.mean(wrong[cruising]) < -0.25
    assert np.mean(told[cruising]) == pytest.approx(np.mean(wrong[cruising]), rel=0.4)
    change = np.mean(wrong[backing]) - np.mean(wrong[before_backing])
    assert change > 0.35
    assert np.mean(told[backing]) - np.mean(told[before_backing]) == pytest.approx(change, rel=0.4)


def test_on_a_mount_that_may_be_loose_the_variance_holds_what_an_arc_bends() -> None:
    """In the arc the forward axis is wrong by more than 2.5 of its usual deviations, and by less than 1.5 of these."""
    (s, P), t = state_of(), Tuning()
    deviations: list[float] = []
    wrong: list[float] = []
    for node in arc_nodes():
        kept = math.exp(-2.0 * node.dt_s / t.acc_bias_tau)
        P[ACC_BIAS, ACC_BIAS] = kept * P[ACC_BIAS, ACC_BIAS] + (1.0 - kept) * t.acc_bias_std**2  # as `fill_noise` does
        widen_tilt(s, P, node, t)
        wrong.append(error_of(node)[0])
        deviations.append(math.sqrt(P[ACC_BIAS, ACC_BIAS]))
    error = max(abs(np.mean(wrong[before(at)])) for at in (14.0, 18.0))
    assert error > 2.5 * t.acc_bias_std
    assert error < 1.5 * min(deviations[k] for k in range(90, 140))


def test_what_goes_straight_on_keeps_its_variance() -> None:
    (s, P), node = state_of(), node_of(dyaw=0.0)
    node["tilt_gain"] = 0.02
    widen_tilt(s, P, node, Tuning())
    assert not P.any()


def tilt_std_of(node: Any) -> float:
    """Standard deviation of the tilt that the gyroscope's unknown bias causes, rad."""
    return math.sqrt(float(node.gyro_tilt_var))


def test_the_unknown_bias_of_a_gyroscope_tilts_by_its_size_times_six_seconds_until_a_rest_has_taught_it() -> None:
    nodes = run(new_frontend(), ride(), np.arange(0.1, 23.9, 0.1)).view(np.recarray)
    assert tilt_std_of(nodes[1]) < 0.3 * tilt_std_of(nodes[38])  # it takes time to tilt
    bias_std = math.sqrt(nodes[38].gyro_bias_var)
    assert 0.25 * TAU * bias_std < tilt_std_of(nodes[38]) < 1.01 * TAU * bias_std
    still = synthesise(np.arange(0.0, 8.0, 0.01), lambda at: np.zeros((len(at), 3)), lambda at: np.zeros((len(at), 3)))
    rng = np.random.default_rng(5)
    still.acc += rng.normal(0.0, 0.02, still.acc.shape)
    still.gyro += rng.normal(0.0, 0.002, still.gyro.shape)
    rested = run(new_frontend(), still, np.arange(0.1, 7.9, 0.1)).view(np.recarray)
    assert tilt_std_of(rested[-1]) < 0.1 * tilt_std_of(nodes[38])


def test_the_biases_gain_that_tilt_on_a_smooth_ride_and_nothing_on_a_rough_one() -> None:
    node = node_of()
    assert tilting_growth(node, 0.0) == 0.0
    node["gyro_tilt_var"] = 0.05**2
    full = (0.05 * G0) ** 2 * -math.expm1(-2.0 * 0.1 / TILTING_S)
    assert 0.7 * full < tilting_growth(node, ROLLING) < tilting_growth(node, 0.0) == pytest.approx(full)
    assert tilting_growth(node, VIBRATING) == 0.0


@pytest.mark.parametrize("dyaw", [-0.4, 0.0, 0.06])
def test_the_covariance_follows_the_jacobian_by_finite_differences(dyaw: float) -> None:
    node = node_of(dyaw=dyaw)
    node["tilt_gain"] = 0.02

    def predicted(s: Any) -> Any:
        after = s.copy()
        predict_tilt(after, np.zeros((N, N)), node)
        return after

    J = jacobian_fd(predicted, STATE)
    # The rotation of the biases themselves by an error of the gyroscope's bias is of second order and left out.
    J[[ACC_BIAS, LEFT_BIAS]] += rotation_by_gyro_bias(predicted(STATE), node)
    root = np.random.default_rng(3).normal(size=(N, N)) * 0.1
    before = root @ root.T
    P = before.copy()
    predict_tilt(STATE.copy(), P, node)
    np.testing.assert_allclose(P, J @ before @ J.T, atol=1e-7)


def rotation_by_gyro_bias(after: Any, node: Any) -> Any:
    """What the finite differences hold of that rotation, with the opposite sign."""
    rows = np.zeros((2, N))
    rows[:, GYRO_BIAS] = np.array([after[LEFT_BIAS], -after[ACC_BIAS]]) * node["dt_s"]
    return rows


@pytest.mark.parametrize(("field", "value"), [("carried", 1), ("rest", 1), ("dt_s", 0.0), ("dv_var", math.inf)])
def test_only_a_vehicle_that_moves_bends_the_tilt(field: str, value: float) -> None:
    node = node_of()
    assert bends_tilt(node, True)
    node[field] = value
    assert not bends_tilt(node, True)
