"""The gyroscope bias in a belief, and the change of its yaw to the reference of a magnetometer."""

import numpy as np
import pytest

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.heading_reference import adopt_reference
from dropanchor_service.estimation.fleet.belief.layout import GYRO_BIAS, MOUNT, REFERENCE, YAW, N, R
from dropanchor_service.estimation.fleet.frontend.node import NODE
from dropanchor_service.estimation.fleet.frontend.standstill import BIAS_SD
from dropanchor_service.estimation.fleet.measurement.rest import update_standstill
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.frontend import new_frontend, run
from support.imu import Motion

TUNING = Tuning().record()[0]


def covariance() -> Array:
    A = np.random.default_rng(5).standard_normal((N, N))
    return 0.01 * (A @ A.T)


def resting(gyro_bias_var: float) -> Array:
    node = np.zeros(1, NODE)
    node["dt_s"], node["dyaw_var"], node["rest"], node["gyro_bias_var"] = 0.1, 4e-7, 1, gyro_bias_var
    return node[0]  # type: ignore[no-any-return]


def test_however_long_a_tag_rests_its_bias_is_no_more_certain_than_in_the_front_end() -> None:
    s, P = np.zeros(N), np.eye(N)
    s[GYRO_BIAS], P[GYRO_BIAS, GYRO_BIAS] = 0.004, 0.01**2
    for _ in range(50):
        assert update_standstill(s, P, np.zeros(N), resting(0.003**2), TUNING) == 0.0
    assert P[GYRO_BIAS, GYRO_BIAS] == pytest.approx(0.003**2, rel=0.01)
    assert 0.0 < s[GYRO_BIAS] < 0.001


def test_a_bias_that_headings_determine_better_than_rest_is_kept() -> None:
    s, P = np.zeros(N), np.eye(N)
    s[GYRO_BIAS], P[GYRO_BIAS, GYRO_BIAS] = 0.004, 0.001**2
    update_standstill(s, P, np.zeros(N), resting(0.01**2), TUNING)
    assert (s[GYRO_BIAS], P[GYRO_BIAS, GYRO_BIAS]) == (0.004, 0.001**2)


def test_yaw_that_counts_from_the_reference_leaves_the_course_as_it_was() -> None:
    P, before = covariance(), covariance()
    adopt_reference(P, 0.02)
    course = np.zeros(N)
    course[[YAW, MOUNT]] = 1.0
    assert course @ P @ course == pytest.approx(course @ before @ course)
    assert (P @ course)[R] == pytest.approx((before @ course)[R])
    heading = np.zeros(N)
    heading[[YAW, REFERENCE]] = 1.0
    assert heading @ P @ heading == pytest.approx(0.0, abs=1e-15)  # the reference agrees with it, exactly, now
    assert P[YAW, YAW] == pytest.approx(0.02)
    assert np.linalg.eigvalsh(P).min() > -1e-12


def test_a_bias_learned_at_rest_comes_with_its_step() -> None:
    rng, t = np.random.default_rng(1), np.arange(0.0, 6.0, 0.01)
    acc = np.tile([0.0, 0.0, 9.80665], (len(t), 1)) + 0.01 * rng.standard_normal((len(t), 3))
    gyro = np.tile([0.0, 0.0, 0.006], (len(t), 1)) + 0.002 * rng.standard_normal((len(t), 3))
    nodes = run(new_frontend(), Motion(t, acc, gyro, np.full((len(t), 3), np.nan), None), np.arange(0.1, 5.9, 0.1))
    assert nodes["gyro_bias_var"][0] == pytest.approx(BIAS_SD**2, rel=0.05)
    assert nodes["gyro_bias_var"][-1] < 0.003**2
    assert nodes["gyro_bias_step"].sum() == pytest.approx(0.006, abs=0.001)
