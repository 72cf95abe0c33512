"""The equations of the pose belief against finite differences, a readable step and the linear Kalman filter."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.fleet.belief.heading_update import update_heading
from dropanchor_service.estimation.fleet.belief.layout import (
    ACC_BIAS,
    GYRO_BIAS,
    MOUNT,
    PHI,
    RANGE_BIAS,
    REFERENCE,
    SLIP,
    YAW,
    N,
    R,
    V,
)
from dropanchor_service.estimation.fleet.belief.predict import predict_covariance, predict_state
from dropanchor_service.estimation.fleet.measurement.bearing import update_bearing
from dropanchor_service.estimation.fleet.measurement.range import predict_range, update_range
from dropanchor_service.estimation.fleet.measurement.scalar import project
from dropanchor_service.estimation.fleet.measurement.speed import truncate_speed
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.belief import STATE, hypothesis_of, jacobian_fd, node_of

DECAY = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.97, 1.0, 0.98, 0.995, 1.0, 0.98])


def readable_step(s: Any, node: Any) -> Any:
    """Return the same step in Cartesian coordinates, from the motion and not from the polar formulas."""
    dt = node["dt_s"]
    w = node["dyaw"] - s[GYRO_BIAS] * dt
    mount = s[MOUNT] + s[SLIP]
    middle = mount + w / 2  # the course in the middle of the node, seen from the body at its start
    along = np.array([math.cos(middle), math.sin(middle)]) @ [node["dv_forward"], node["dv_left"]] - s[ACC_BIAS] * dt
    course = s[YAW] + middle
    place = s[R] * np.array([math.cos(s[PHI]), math.sin(s[PHI])])
    place = place + (s[V] * dt + along * dt / 2) * np.array([math.cos(course), math.sin(course)])
    c, sn = math.cos(s[YAW]), math.sin(s[YAW])
    place = place + np.array([[c, -sn], [sn, c]]) @ [node["swing_forward"], node["swing_left"]]
    out = s.copy()
    out[R], out[PHI] = np.hypot(*place), math.atan2(place[1], place[0])
    out[YAW], out[V] = s[YAW] + w, s[V] + along
    out[4:] *= DECAY[4:]
    return out


def stepped(s: Any, node: Any) -> tuple[Any, Any]:
    s, F = s.copy(), np.zeros((4, N))
    predict_state(s, node, DECAY, F)
    return s, F


def covariance(seed: int = 3) -> Any:
    A = np.random.default_rng(seed).standard_normal((N, N)) * 0.05
    return A @ A.T + np.diag(np.full(N, 1e-3))


@pytest.mark.parametrize("swing", [(0.0, 0.0), (-0.1, 0.3)])
@pytest.mark.parametrize("dyaw", [-0.4, 0.0, 0.06])
def test_a_polar_step_is_the_cartesian_step(dyaw: float, swing: tuple[float, float]) -> None:
    node = node_of(dyaw=dyaw, swing=swing)
    np.testing.assert_allclose(stepped(STATE, node)[0], readable_step(STATE, node), atol=1e-12)


@pytest.mark.parametrize("swing", [(0.0, 0.0), (-0.1, 0.3)])
@pytest.mark.parametrize("dyaw", [-0.4, 0.0, 0.06])
def test_the_jacobian_of_the_step_equals_finite_differences(dyaw: float, swing: tuple[float, float]) -> None:
    node = node_of(dyaw=dyaw, swing=swing)
    expected = jacobian_fd(lambda s: readable_step(s, node)[:4], STATE)
    np.testing.assert_allclose(stepped(STATE, node)[1], expected, atol=1e-7)


@pytest.mark.parametrize("mount", [0.0, 0.4])
def test_a_turn_at_constant_speed_leaves_the_speed_as_it_was(mount: float) -> None:
    speed, turn = 3.0, 0.5
    s = STATE.copy()
    s[V], s[MOUNT], s[SLIP], s[GYRO_BIAS], s[ACC_BIAS] = speed, mount, 0.0, 0.0, 0.0
    later, before = mount + turn, mount
    node = node_of(
        dyaw=turn,
        forward=speed * (math.cos(later) - math.cos(before)),
        left=speed * (math.sin(later) - math.sin(before)),
    )
    assert stepped(s, node)[0][V] == pytest.approx(speed, abs=1e-12)


def test_the_covariance_is_carried_by_the_whole_jacobian() -> None:
    node, P = node_of(), covariance()
    A = jacobian_fd(lambda s: readable_step(s, node), STATE)
    expected = A @ P @ A.T
    predict_covariance(P, stepped(STATE, node)[1], DECAY, np.zeros((4, N)))
    np.testing.assert_allclose(P, expected, atol=1e-9)


def predicted(s: Any, H: Any, ox: float = 0.0, oy: float = 0.0, dz: float = 1.5, lag: float = 0.0) -> float:
    """Return the range to an anchor for a scale of 1.05 and a bias of -0.3 m, as measured."""
    return float(predict_range(s, ox, oy, dz, lag, 1.05, -0.3, H))


@pytest.mark.parametrize(("ox", "oy", "lag"), [(0.0, 0.0, 0.0), (3.0, -4.0, 0.0), (0.0, 0.0, 0.2), (3.0, -4.0, 0.1)])
def test_the_jacobian_of_a_range_equals_finite_differences(ox: float, oy: float, lag: float) -> None:
    H = np.zeros(N)
    predicted(STATE, H, ox, oy, lag=lag)
    expected = jacobian_fd(lambda s: np.array([predicted(s, np.zeros(N), ox, oy, lag=lag)]), STATE)[0]
    np.testing.assert_allclose(H, expected, atol=1e-7)


@pytest.mark.parametrize(("ox", "bias"), [(0.0, STATE[RANGE_BIAS]), (3.0, -0.3)])
def test_a_range_is_scale_times_distance_plus_bias(ox: float, bias: float) -> None:
    distance = math.hypot(STATE[R] * math.cos(STATE[PHI]) - ox, STATE[R] * math.sin(STATE[PHI]), 1.5)
    assert predicted(STATE, np.zeros(N), ox) == pytest.approx(1.05 * distance + bias)


def test_a_late_range_is_compared_with_where_the_tag_was() -> None:
    node = node_of(dyaw=0.0, forward=0.0, left=0.0)
    s = STATE.copy()
    s[GYRO_BIAS] = s[ACC_BIAS] = 0.0
    later = readable_step(s, node)
    later[SLIP] = s[SLIP]
    assert predicted(later, np.zeros(N), lag=0.1) == pytest.approx(predicted(s, np.zeros(N)), abs=1e-9)


def kalman(s: Any, P: Any, h: Any, e: float, variance: float) -> tuple[Any, Any]:
    """Return the textbook Joseph form."""
    K = P @ h / (h @ P @ h + variance)
    L = np.eye(N) - np.outer(K, h)
    return s + K * e, L @ P @ L.T + variance * np.outer(K, K)


def test_a_heading_update_is_the_kalman_filter() -> None:
    s, P = STATE.copy(), covariance()
    h = np.zeros(N)
    h[YAW] = h[REFERENCE] = 1.0
    expected = kalman(s, P, h, 0.02, 0.01)
    one, scratch = hypothesis_of(s, P)
    update_heading(one, scratch, STATE[YAW] + STATE[REFERENCE] + 0.02 + 2 * math.pi, 0.01)
    np.testing.assert_allclose(one["mean"], expected[0], atol=1e-12)
    np.testing.assert_allclose(one["cov"], expected[1], atol=1e-12)


def test_a_range_without_outliers_is_the_kalman_filter() -> None:
    s, P, H = STATE.copy(), covariance(), np.zeros(N)
    predicted(s, H, dz=0.0)
    expected = kalman(s, P, H, 0.05, 0.04)
    one, scratch = hypothesis_of(s, P, H)
    update_range(one, scratch, 0.05, 0.04, Tuning(outlier_probability=0.0))
    np.testing.assert_allclose(one["mean"], expected[0], atol=1e-12)
    np.testing.assert_allclose(one["cov"], expected[1], atol=1e-12)


def test_a_range_mixes_hit_and_outlier_by_their_probabilities() -> None:
    s, P, H, t = STATE.copy(), covariance(), np.zeros(N), Tuning()
    predicted(s, H, dz=0.0)
    e, variance = 0.6, 0.04
    S = H @ P @ H + variance

    def density(x: float, var: float) -> float:
        return math.exp(-0.5 * x * x / var) / math.sqrt(2 * math.pi * var)

    hit = (1 - t.outlier_probability) * density(e, S)
    miss = t.outlier_probability * (density(e - t.outlier_mean, S + t.outlier_std**2) + t.outlier_floor)
    taken = kalman(s, P, H, e, variance)
    beta = hit / (hit + miss)
    mean = beta * taken[0] + (1 - beta) * s
    spread = beta * np.outer(taken[0] - mean, taken[0] - mean) + (1 - beta) * np.outer(s - mean, s - mean)
    expected = beta * taken[1] + (1 - beta) * P + spread
    one, scratch = hypothesis_of(s, P, H)
    update_range(one, scratch, e, variance, t)
    np.testing.assert_allclose(one["mean"], mean, atol=1e-12)
    np.testing.assert_allclose(one["cov"], expected, atol=1e-12)
    assert scratch["out"][0] == pytest.approx(math.log(hit + miss))
    assert scratch["out"][2] == pytest.approx(1 - beta)


def test_a_bearing_moves_the_tag_towards_it() -> None:
    s, P = STATE.copy(), covariance()
    P[PHI, PHI] += 0.2
    one, scratch = hypothesis_of(s, P)
    update_bearing(one, scratch, 0.0, 0.0, 0.9, math.nan, 1e-4)
    assert one["mean"][PHI] == pytest.approx(0.9, abs=0.01)
    assert np.linalg.eigvalsh(one["cov"]).min() > 0


def test_a_negative_speed_is_cut_to_the_moments_of_the_truncated_gaussian() -> None:
    s, P = STATE.copy(), np.diag(np.full(N, 1e-3))
    s[V], P[V, V] = -0.3, 0.25
    draws = s[V] + 0.5 * np.random.default_rng(0).standard_normal(400_000)
    kept = draws[draws > 0.0]
    log_mass = truncate_speed(s, P, np.zeros(N), 0.0, 10.0)
    assert s[V] == pytest.approx(kept.mean(), abs=2e-3)
    assert P[V, V] == pytest.approx(kept.var(), abs=2e-3)
    assert math.exp(log_mass) == pytest.approx(len(kept) / len(draws), abs=2e-3)


def test_projection_is_the_matrix_product() -> None:
    P, H, PH = covariance(), np.zeros(N), np.zeros(N)
    H[R], H[PHI], H[RANGE_BIAS] = 0.9, -0.3, 1.0
    assert project(P, H, PH) == pytest.approx(H @ P @ H)
    np.testing.assert_allclose(PH, P @ H, atol=1e-15)
