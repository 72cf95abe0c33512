"""Splitting of hypotheses over whose errors the range rate is not linear."""

from math import pi
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.fleet.belief.births.splitting import curvature, is_curved, is_wide
from dropanchor_service.estimation.fleet.belief.layout import PHI, ROW, YAW, N, R, V
from dropanchor_service.estimation.fleet.belief.mixture import angle_variance
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.tuning import Tuning

TUNING = Tuning().record()[0]


def travelling(angle: float, speed: float, speed_std: float, angle_std: float = 0.04) -> Any:
    """Return one hypothesis of a tag that travels at this angle, rad, from its line of sight."""
    work = make_workspace()["hypotheses"][0]
    work["mean"][0, [R, PHI, YAW, V]] = 19.0, 0.3, 0.3 + angle, speed
    work["cov"][0] = np.zeros((N, N))
    work["cov"][0, PHI, PHI], work["cov"][0, V, V] = angle_std**2, speed_std**2
    return work


def is_split(work: Any) -> bool:
    row = np.zeros(1, ROW)[0]
    return bool(is_wide(work[0], row, TUNING) or is_curved(work[0], TUNING))


def test_a_slow_tag_of_uncertain_speed_is_split_where_it_travels_across_the_line_of_sight() -> None:
    assert is_split(travelling(pi / 2, speed=0.4, speed_std=0.3))
    assert not is_split(travelling(0.0, speed=0.4, speed_std=0.3))
    assert not is_split(travelling(pi / 2, speed=0.4, speed_std=0.03))
    assert not is_split(travelling(pi / 2, speed=4.0, speed_std=0.3))


@pytest.mark.parametrize("angle", [pi / 2, -pi / 2])
def test_the_curvature_is_the_share_of_the_range_rate_that_a_linear_update_leaves_out(angle: float) -> None:
    rng = np.random.default_rng(1)
    dv, da = 0.5 * rng.standard_normal(100_000), 0.1 * rng.standard_normal(100_000)
    linear = np.cos(angle) * dv - 2.0 * np.sin(angle) * da
    rest = (2.0 + dv) * np.cos(angle + da) - 2.0 * np.cos(angle) - linear
    work = travelling(angle, speed=2.0, speed_std=0.5, angle_std=0.1)
    assert curvature(work[0], angle_variance(work["cov"][0])) == pytest.approx(np.std(rest) / np.std(linear), rel=0.05)
