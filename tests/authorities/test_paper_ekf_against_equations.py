"""The paper's extended Kalman filter against finite differences and a linear Kalman filter."""

import math
from collections.abc import Callable

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.paper import ekf
from dropanchor_service.estimation.paper.ekf import PoseFilter

STATES = st.tuples(
    st.floats(-80, 80), st.floats(-80, 80), st.floats(-3.1, 3.1), st.floats(-5, 8), st.floats(-3, 3)
).map(np.array)
Q = np.array([0.01, 0.01, 0.02, 0.3, 0.2])


def finite_difference(function: Callable[[Array], Array], x: Array, step: float = 1e-6) -> Array:
    columns = [(function(x + step * e) - function(x - step * e)) / (2 * step) for e in np.eye(len(x))]
    return np.stack(columns, axis=-1)


@given(x=STATES, dt=st.floats(0.001, 0.2))
def test_the_jacobian_of_the_motion_is_its_derivative(x: Array, dt: float) -> None:
    if abs(x[2] + x[4] * dt) < math.pi - 1e-3:  # the wrap is not differentiable
        np.testing.assert_allclose(ekf.F(x, dt), finite_difference(lambda s: ekf.f(s, dt), x), atol=1e-6)


@given(x=STATES, height=st.floats(-3, 3))
def test_the_jacobian_of_the_range_is_its_derivative(x: Array, height: float) -> None:
    anchor = (1.0, -2.0, height)
    if ekf.h_range(x, anchor) > 0.1:
        expected = finite_difference(lambda s: np.array([ekf.h_range(s, anchor)]), x)
        np.testing.assert_allclose(ekf.H_range(x, anchor), expected, atol=1e-5)


def test_on_a_linear_problem_it_equals_the_kalman_filter_written_out() -> None:
    """Range and motion are linear in (x, v) on the x axis, for a tag that heads east and does not turn."""
    rng = np.random.default_rng(5)
    still = np.array([Q[0], 0.0, 0.0, Q[3], 0.0])
    pose = PoseFilter(np.array([10.0, 0.0, 0.0, 1.0, 0.0]), np.diag([1.0, 0.0, 0.0, 0.5, 0.0]), still)
    x, P = np.array([10.0, 1.0]), np.diag([1.0, 0.5])
    H = np.array([[1.0, 0.0]])
    for _ in range(50):
        dt, z = rng.uniform(0.01, 0.5), rng.uniform(9, 30)
        A = np.array([[1.0, dt], [0.0, 1.0]])
        x, P = A @ x, A @ P @ A.T + np.diag([Q[0], Q[3]]) * dt
        K = P @ H.T / (H @ P @ H.T + 0.04)
        x, P = x + K[:, 0] * (z - x[0]), (np.eye(2) - K @ H) @ P
        pose.advance(dt)
        assert pose.update_range(z, 0.04, (0.0, 0.0, 0.0), gate=math.inf).fused
        np.testing.assert_allclose(pose.x[[0, 3]], x, rtol=1e-10)
        np.testing.assert_allclose(pose.P[np.ix_([0, 3], [0, 3])], P, rtol=1e-8)
