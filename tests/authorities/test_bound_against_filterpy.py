"""The posterior Cramér-Rao bound against filterpy's Kalman filter and against Tichavský's information recursion."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from dropanchor_evaluation.pcrb import Path, Sensors, position_bound

N, DT = 400, 0.05
T = DT * np.arange(N)


def radial() -> Path:
    """Return a path that leads straight away from the anchor along x at 1.5 m/s. With an exact heading it is linear."""
    return Path(T, 5.0 + 1.5 * T, np.zeros(N), np.zeros(N), np.full(N, 1.5), np.ones(N, bool))


def test_on_a_linear_problem_the_bound_is_the_covariance_of_the_kalman_filter() -> None:
    exact = Sensors(heading=1e-7, gyro=0.0, gyro_bias=0.0, start_heading=1e-9, start=0.3, start_speed=0.5)
    bound = position_bound(radial(), exact, "range+heading, jumps known")
    kalman = KalmanFilter(dim_x=2, dim_z=1)
    kalman.F, kalman.H, kalman.R = np.array([[1, DT], [0, 1]]), np.array([[1.0, 0.0]]), np.array([[0.2**2]])
    kalman.P, kalman.Q = np.diag([0.3**2, 0.5**2]), np.diag([0.0, 1e-10])
    expected = []
    for i in range(N):
        if i:
            kalman.predict()
        kalman.update(0.0)
        expected.append(kalman.P[0, 0] + 0.3**2)  # the ranges tell nothing about y
    np.testing.assert_allclose(bound, expected, rtol=1e-5)


def test_the_bound_agrees_with_the_information_recursion_of_tichavsky() -> None:
    s = Sensors()
    t = DT * np.arange(60)
    path = Path(t, 10 + t, 4 + 2 * t, np.full(60, np.arctan2(2, 1)), np.full(60, np.sqrt(5)), np.ones(60, bool))
    bound = position_bound(path, s, "range+heading, random-walk speed")
    tiny = 1e-12
    J = np.linalg.inv(np.diag([s.start, s.start, s.start_heading, s.start_speed, s.gyro_bias]) ** 2)
    Q = np.diag([tiny, tiny, (s.gyro * DT) ** 2, 1e-10, tiny])
    for i in range(60):
        if i:
            c, w = np.cos(path.course[i - 1]), np.sin(path.course[i - 1])
            F = np.eye(5)
            F[0, 2:4], F[1, 2:4], F[2, 4] = (-path.v[0] * w * DT, c * DT), (path.v[0] * c * DT, w * DT), -DT
            J = np.linalg.inv(Q + F @ np.linalg.inv(J) @ F.T)
        r = np.hypot(path.x[i], path.y[i])
        H = np.array([[path.x[i] / r, path.y[i] / r, 0, 0, 0], [0, 0, 1, 0, 0]])
        J = J + H.T @ np.diag([1 / s.range**2, 1 / s.heading**2]) @ H
    P = np.linalg.inv(J)
    assert bound[-1] == pytest.approx(P[0, 0] + P[1, 1], rel=1e-4)
