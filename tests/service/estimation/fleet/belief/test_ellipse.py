"""The ellipse that is published of several hypotheses."""

from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.fleet.belief.layout import PHI, N, R
from dropanchor_service.estimation.fleet.belief.mixture import normalise
from dropanchor_service.estimation.fleet.belief.summary import cluster, fill_positions, moments, spread_over_families
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace

DISTANCE, STD = 10.0, 0.1  # m
REJECTED = 1e-3


def ellipse_of(weight: float, apart: float) -> Any:
    """Return the covariance of (x, y) of a tag on the x axis that may, with this weight, be `apart` m along y."""
    space = make_workspace()[0]
    work, scratch = space["hypotheses"], space["scratch"]
    bearing = 2.0 * np.arcsin(apart / 2.0 / DISTANCE)
    for one, angle, share in zip(work, (0.0, bearing), (1.0 - weight, weight), strict=False):
        one["mean"][R], one["mean"][PHI], one["log_weight"] = DISTANCE, angle, np.log(share)
        one["cov"][:] = np.diag(np.full(N, 1e-9))
        one["cov"][R, R], one["cov"][PHI, PHI] = STD**2, (STD / DISTANCE) ** 2
    normalise(work, 2)
    fill_positions(work, 2)
    assert cluster(work, 2, 0) == pytest.approx(1.0 - weight)
    moments(work, 2, 0, scratch)
    spread_over_families(work, 2, 0, scratch, REJECTED)
    return scratch["cov"][:2, :2]


@pytest.mark.parametrize("weight", [0.04, 0.08])
def test_another_place_that_is_possible_is_within_five_standard_deviations(weight: float) -> None:
    apart = 4.0
    bearing = 2.0 * np.arcsin(apart / 2.0 / DISTANCE)
    there = DISTANCE * np.array([np.cos(bearing) - 1.0, np.sin(bearing)])
    cov = ellipse_of(weight, apart)
    assert cov[1, 1] == pytest.approx(STD**2 + weight * there[1] ** 2, rel=0.1)
    assert np.sqrt(there @ np.linalg.solve(cov, there)) < 5.0
