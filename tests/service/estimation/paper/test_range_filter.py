"""The Kalman filter in front of the speed estimator."""

import numpy as np
import pytest

from dropanchor_service.estimation.paper.range_filter import RangeFilter


def test_noise_on_a_constant_range_is_smoothed_away() -> None:
    rng = np.random.default_rng(3)
    smooth = RangeFilter(10.0, q=1e-6, R=0.04)
    values = [smooth.step(0.1, 10 + rng.normal(0, 0.2)) for _ in range(2000)]
    assert np.std(values[500:]) < 0.02
    assert np.mean(values[500:]) == pytest.approx(10.0, abs=0.02)


def test_it_equals_the_scalar_kalman_filter_written_out() -> None:
    rng = np.random.default_rng(4)
    smooth, r, P = RangeFilter(3.0, q=0.2, R=0.1), 3.0, 0.1
    for _ in range(100):
        dt, z = rng.uniform(0.01, 1.0), rng.uniform(2, 4)
        P += 0.2 * dt
        r, P = r + P / (P + 0.1) * (z - r), P * 0.1 / (P + 0.1)
        assert smooth.step(dt, z) == pytest.approx(r)
