"""Merging of hypotheses."""

from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.fleet.belief.layout import PHI, ROW, N, R
from dropanchor_service.estimation.fleet.belief.mixture import max_hypotheses, merge, normalise
from dropanchor_service.estimation.fleet.belief.step import REDUCE_EVERY, _reduce_mixture
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.belief import node_of

STD = 0.2  # m, of the distance


def pair(apart: float, log_weight: float) -> Any:
    """Return two hypotheses with this distance in standard deviations. The second has this log weight to the first."""
    work = make_workspace()["hypotheses"][0]
    for h, (distance, weight) in enumerate([(10.0, 0.0), (10.0 + apart * STD, log_weight)]):
        work["mean"][h, R], work["mean"][h, PHI] = distance, 0.3
        work["cov"][h] = np.diag(np.full(N, STD**2))
        work["log_weight"][h] = weight
    normalise(work, 2)
    return work


def test_equal_ones_merge_when_they_are_within_the_distance() -> None:
    assert merge(pair(apart=0.4, log_weight=0.0), 2, 0.5, 0.5) == 1
    assert merge(pair(apart=0.9, log_weight=0.0), 2, 0.5, 0.5) == 2


def test_a_light_one_is_absorbed_from_further_away_but_not_from_another_place() -> None:
    assert merge(pair(apart=0.9, log_weight=-8.0), 2, 0.5, 0.5) == 1
    assert merge(pair(apart=3.0, log_weight=-8.0), 2, 0.5, 0.5) == 2


def test_what_is_merged_keeps_weight_mean_and_variance_of_the_two() -> None:
    work = pair(apart=0.7, log_weight=-3.0)
    share = float(np.exp(work["log_weight"][1]))
    assert merge(work, 2, 0.5, 0.5) == 1
    assert np.isclose(work["log_weight"][0], 0.0)
    assert np.isclose(work["mean"][0, R], 10.0 + share * 0.7 * STD)
    assert np.isclose(work["cov"][0, R, R], STD**2 + share * (1.0 - share) * (0.7 * STD) ** 2)


def test_too_many_are_merged_and_not_dropped_so_that_they_stay_as_uncertain_as_they_were() -> None:
    row, work, count = np.zeros(1, ROW)[0], make_workspace()["hypotheses"][0], 120
    row["start"]["known"], row["since_reduction_s"] = 1, REDUCE_EVERY
    work["mean"][:count, R] = 50.0 + 0.8 * STD * np.arange(count)
    work["cov"][:count] = np.diag(np.full(N, 1e-6))
    work["cov"][:count, R, R] = STD**2
    before = work["mean"][:count, R].var() + STD**2
    count = _reduce_mixture(work, count, row, node_of(), Tuning().record()[0])
    normalise(work, count)
    weight, r = np.exp(work["log_weight"][:count]), work["mean"][:count, R]
    after = weight @ (work["cov"][:count, R, R] + (r - weight @ r) ** 2)
    assert count <= max_hypotheses(row, Tuning().record()[0]) < 120
    assert after == pytest.approx(before, rel=0.01)
