"""The parts of a place's uncertainty are what knowing each of its causes would take away."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.columns import ANCHOR
from dropanchor_service.estimation.fleet.belief.layout import BELIEF, MOUNT, PHI, ROW, SLIP, YAW, N, R, V
from dropanchor_service.estimation.fleet.belief.parts import fill_parts
from dropanchor_service.estimation.fleet.belief.summary import fill_positions, spread_over_all
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from support.belief import STATE
from support.fleet_runs import engine, in_pieces, samples, settings

WEIGHTS = (0.5, 0.3, 0.2)


def a_mixture(seed: int) -> tuple[Any, Any]:
    """Return three hypotheses with correlated errors, and scratch with their mean."""
    space = make_workspace()[0]
    rng = np.random.default_rng(seed)
    for one, weight in zip(space["hypotheses"], WEIGHTS, strict=False):
        half = rng.normal(size=(N, N)) * 0.02
        one["mean"], one["cov"] = STATE + rng.normal(size=N) * 0.03, half @ half.T
        one["log_weight"] = math.log(weight)
    work = space["hypotheses"][: len(WEIGHTS)]
    mean = np.average(work["mean"], axis=0, weights=WEIGHTS)
    scratch = space["scratch"]
    course = mean[YAW] + mean[MOUNT] + mean[SLIP]
    scratch["mean"] = mean[R] * math.cos(mean[PHI]), mean[R] * math.sin(mean[PHI]), course, mean[V], mean[YAW]
    return work, scratch


def samples_of(work: Any, count: int = 200_000) -> Any:
    """Return samples (yaw, mount + slip, v, phi, r) of the mixture."""
    rng = np.random.default_rng(7)
    drawn = [
        rng.multivariate_normal(one["mean"], one["cov"], size=round(count * weight))
        for one, weight in zip(work, WEIGHTS, strict=True)
    ]
    s = np.concatenate(drawn)
    return np.column_stack([s[:, YAW], s[:, MOUNT] + s[:, SLIP], s[:, V], s[:, PHI], s[:, R]])


def variance_left(samples: Any, known: int) -> float:
    """Return the variance of phi, given the first `known` columns: that of the residuals of a least-squares fit."""
    centred = samples - samples.mean(axis=0)
    if known == 0:
        return float(np.var(centred[:, 3]))
    fit, *_ = np.linalg.lstsq(centred[:, :known], centred[:, 3], rcond=None)
    return float(np.var(centred[:, 3] - centred[:, :known] @ fit))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_each_part_is_what_knowing_its_cause_takes_away(seed: int) -> None:
    work, scratch = a_mixture(seed)
    row, anchor, belief = (np.zeros((), dtype).view(np.recarray)[()] for dtype in (ROW, ANCHOR, BELIEF))
    fill_positions(work, len(work))
    spread_over_all(work, len(work), scratch)
    belief["sigma_pos"] = math.sqrt(scratch["cov"][0, 0] + scratch["cov"][1, 1])
    fill_parts(row, anchor, scratch, belief)
    parts = belief["parts"]
    samples = samples_of(work)
    left = np.array([variance_left(samples, known) for known in range(4)])
    shares = np.append(-np.diff(left), left[3]) / left[0]
    across = belief["sigma_pos"] ** 2 - np.var(samples[:, 4])
    np.testing.assert_allclose(parts[:4] ** 2, shares * across, atol=0.02 * across)
    assert parts[4] == pytest.approx(np.std(samples[:, 4]), rel=0.02)
    assert parts[5] == 0.0
    assert np.sum(parts**2) == pytest.approx(belief["sigma_pos"] ** 2)


def test_the_part_of_the_height_is_what_it_changes_of_the_distance() -> None:
    work, scratch = a_mixture(1)
    row, anchor, belief = (np.zeros((), dtype).view(np.recarray)[()] for dtype in (ROW, ANCHOR, BELIEF))
    row["settings"]["height"], row["settings"]["height_std"], anchor["z"] = 1.0, 0.1, 4.0
    fill_positions(work, len(work))
    spread_over_all(work, len(work), scratch)
    belief["sigma_pos"] = 1.0
    fill_parts(row, anchor, scratch, belief)
    heights = np.random.default_rng(3).normal(-3.0, 0.1, 100_000)
    distance = np.sqrt(np.hypot(STATE[R], 3.0) ** 2 - heights**2)
    assert belief["parts"][5] == pytest.approx(np.std(distance), rel=0.1)


def test_the_parts_of_every_pose_add_up_and_north_is_gone_once_it_is_told() -> None:
    batch, _ = samples(1)
    north = []
    for heading_std in (0.3, 0.01):
        fleet = engine(known=False)
        told = settings(known=False)
        told["heading_std"] = heading_std
        fleet.configure(0, told)
        poses = in_pieces(fleet, batch, 1_000_000_000)
        placed = poses[np.isfinite(poses["x"])]
        assert len(placed) > 100
        np.testing.assert_allclose((placed["parts"] ** 2).sum(axis=1), placed["sigma_pos"] ** 2, rtol=1e-9)
        last = placed[-1]
        north.append(float(last["parts"][0]) / math.hypot(last["x"], last["y"]))
    assert north[0] > 0.25
    assert north[1] < 0.03
