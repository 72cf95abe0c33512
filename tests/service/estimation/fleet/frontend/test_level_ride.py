"""What a smooth and level ride tells of the gyroscope's bias."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dropanchor_service.estimation.fleet.frontend.attitude import ATTITUDE
from dropanchor_service.estimation.fleet.frontend.level_ride import UNEVEN, learn_from_level_ride
from dropanchor_service.estimation.fleet.frontend.standstill import STANDSTILL
from support.fleet_attitude import rotations
from support.frontend import new_frontend, run
from support.imu import synthesise

Array = NDArray[Any]
DT = 0.01
BIAS = np.array([0.012, -0.017, 0.0])  # rad/s


def rows(bias_std: float = 0.01, cov: float = 0.0, gyro_var: float = 2e-5) -> tuple[Any, Any]:
    """Return a level attitude whose tilt is known to 0.02 rad, and a detector that has seen a second."""
    a, s = np.zeros(1, ATTITUDE), np.zeros(1, STANDSTILL)
    a[0]["q"] = 1.0, 0.0, 0.0, 0.0
    a[0]["tilt_cov"] = 4e-4, cov, bias_std**2
    s[0]["seen"], s[0]["gyro_bias_var"] = 1.0, gyro_var
    return a[0], s[0]


def floor(t: Array) -> Array:
    return np.zeros((len(t), 3))


def onto_a_ramp(t: Array) -> Array:
    """Pitch up by 0.1 rad within a second."""
    return np.stack([0 * t, -0.1 * np.clip(t - 5.0, 0.0, 1.0), 0 * t], axis=1)


def after(seconds: float, angles: Callable[[Array], Array] = floor, pushed: bool = True) -> tuple[Array, Array, int]:
    """Return the errors of tilt (2,), rad, and bias (3,), rad/s, after a ride, and how many nodes were at rest."""
    rng = np.random.default_rng(8)
    m = synthesise(
        np.arange(0, seconds, DT),
        angles,
        lambda t: np.stack([np.where(pushed & (t > 1.2) & (t < 3.2), 0.6, 0.0), 0 * t, 0 * t], axis=1),
    )
    m.gyro += BIAS + rng.normal(0, 0.003, m.gyro.shape)
    m.acc += rng.normal(0, 0.06, m.acc.shape)
    f = new_frontend()
    nodes = run(f, m, np.arange(0.1, seconds, 0.1))
    q = f[0]["attitude"]["q"]
    up = rotations(q).inv().apply([0.0, 0.0, 1.0]) - m.attitude[-1].inv().apply([0.0, 0.0, 1.0])
    return up[:2], f[0]["attitude"]["bias"] - BIAS, int((nodes["rest"] != 0).sum())


def test_tilt_and_bias_are_updated_as_by_a_kalman_filter_of_both() -> None:
    a, s = rows(cov=1.5e-4)
    P = np.array([[4e-4, 1.5e-4], [1.5e-4, 1e-4]])
    x = np.zeros(2)
    for rate in np.random.default_rng(1).normal(0.004, 0.003, 50):
        H, innovation = np.array([0.0, 1.0]), rate - x[1]
        S = H @ P @ H + UNEVEN / DT
        K = P @ H / S
        x, P = x + K * innovation, P - np.outer(K, H @ P)
        learn_from_level_ride(a, s, DT, np.array([0.0, rate, 0.0]))
    up = rotations(a["q"]).inv().apply([0.0, 0.0, 1.0])
    assert a["bias"] == pytest.approx([0.0, x[1], 0.0], abs=1e-9)
    assert math.atan2(up[0], up[2]) == pytest.approx(x[0], rel=1e-3)
    assert a["tilt_cov"] == pytest.approx([P[0, 0], P[0, 1], P[1, 1]], rel=1e-9)


def test_an_uneven_floor_leaves_no_larger_error_than_the_covariance_says() -> None:
    rng = np.random.default_rng(2)
    errors = []
    for _ in range(200):
        a, s = rows()
        bias, period = rng.normal(0, 0.01), rng.uniform(2.0, 6.0)
        phase, height = rng.uniform(0, 2 * math.pi), 0.008  # rad, of the waves in the tilt
        waves = 2 * math.pi / period
        for t in np.arange(0, 10, DT):
            rate = bias + height * waves * math.cos(waves * t + phase) + rng.normal(0, 0.003)
            learn_from_level_ride(a, s, DT, np.array([rate, 0.0, 0.0]))
        errors.append(bias - a["bias"][0])
    variance = float(a["tilt_cov"][2])
    assert np.mean(np.square(errors)) < variance < 0.002**2


@pytest.mark.parametrize(
    ("rates", "gyro_var"),
    [
        ([0.02, 0.0, 0.0], 4e-4),  # it shakes
        ([0.02, 0.0, 0.3], 2e-5),  # it turns
        ([0.0, 0.2, 0.0], 2e-5),  # it tilts
    ],
)
def test_another_ride_teaches_nothing(rates: list[float], gyro_var: float) -> None:
    a, s = rows(gyro_var=gyro_var)
    before = a.tobytes()
    learn_from_level_ride(a, s, DT, np.array(rates))
    assert a.tobytes() == before


def test_a_gyroscope_that_no_rest_has_taught_hardly_tilts_a_smooth_ride() -> None:
    tilt, bias, rests = after(6.0)
    assert rests == 0
    assert np.hypot(*tilt) < 0.035  # 0.11 rad without; 0.02 of it is the push, which the tilt takes for gravity
    assert np.hypot(*bias[:2]) < 0.004


def test_a_ramp_is_no_bias() -> None:
    _, bias, _ = after(12.0, onto_a_ramp, pushed=False)
    assert np.hypot(*bias[:2]) < 0.004
