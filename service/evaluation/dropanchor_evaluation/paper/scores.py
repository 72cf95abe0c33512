"""Scores of an estimator on a run with a known start, and over all runs of a case."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_evaluation.pcrb import Information, Path, Sensors, position_bound
from dropanchor_evaluation.simulated import truth_of
from dropanchor_service.answers.kernels.ageing import CHI2_95_OF_2
from dropanchor_service.estimation.columns import Array
from dropanchor_service.offline.accuracy import nees, truth_at
from dropanchor_service.offline.replay import Track
from dropanchor_tag_client.simulator.simulation import Simulation

LOST_M = 2.0


@dataclass(frozen=True)
class RunScore:
    """The score of one run.

    mse: mean over its poses, m²; inf if it never had a position. bound: its Cramér-Rao bound, m². nees: mean normalised
    squared error. coverage: share of the truth inside the 95 % ellipse. missing: share of poses without a position.
    """

    mse: float
    bound: float
    nees: float
    coverage: float
    missing: float


@dataclass(frozen=True)
class Row:
    """A case over all its runs. RMSE of the runs, m: median, 90 % quantile, worst, and the share of runs above 2 m.

    nees_half: NEES / 2; 1 for a consistent covariance. ratio: √(mean MSE) / √(mean bound). median_ratio: median over
    the runs.
    """

    median: float
    p90: float
    worst: float
    above_2m: float
    nees_half: float
    coverage: float
    ratio: float
    median_ratio: float
    missing: float


def score(simulation: Simulation, track: Track, bound: Array) -> RunScore:
    """Compare a track with the truth. bound: (n,) m² at the instants of the truth."""
    poses = track.poses
    x, y = truth_at(truth_of(simulation), track.t)
    known = np.isfinite(poses["x"]) & np.isfinite(x)
    if not known.any():
        return RunScore(np.inf, float(bound.mean()), np.nan, 0.0, 1.0)
    error = np.column_stack([poses["x"] - x, poses["y"] - y])[known]
    normalised = nees(error, poses["cov"][known][:, :2, :2])
    return RunScore(
        mse=float(np.mean(error[:, 0] ** 2 + error[:, 1] ** 2)),
        bound=float(np.mean(np.interp(track.t[known], simulation.truth.t_s, bound))),
        nees=float(np.nanmean(normalised)) if np.isfinite(normalised).any() else np.nan,
        coverage=float(np.mean(normalised <= CHI2_95_OF_2)),
        missing=float(1 - known.mean()),
    )


def bound_of(simulation: Simulation, sensors: Sensors, information: Information | None) -> Array:
    """Return the bound of the run, (n,) m², with ranges at the instants of the run's own ranges.

    It is NaN without information, and if the bound assumes speed jumps but the speed changes all the time.
    """
    truth = simulation.truth
    if information is None or (information != "with accelerometer" and _never_constant(truth.v)):
        return np.full(len(truth.t_s), np.nan)
    ranged = np.zeros(len(truth.t_s), bool)
    ranged[np.searchsorted(truth.t_s, simulation.ranges.t_s - 1e-6)] = True
    path = Path(truth.t_s, truth.x, truth.y, truth.course, truth.v, ranged)
    return position_bound(path, sensors, information)


def summary(scores: Sequence[RunScore]) -> Row:
    mse, bound, nees_, coverage, missing = (
        np.array([getattr(one, name) for one in scores]) for name in ("mse", "bound", "nees", "coverage", "missing")
    )
    rmse = np.sqrt(mse)
    return Row(
        median=float(np.median(rmse)),
        p90=float(np.quantile(rmse, 0.9)),
        worst=float(rmse.max()),
        above_2m=float(np.mean(rmse > LOST_M)),
        nees_half=float(nees_.mean()) / 2,
        coverage=float(coverage.mean()),
        ratio=float(np.sqrt(mse.mean() / bound.mean())),
        median_ratio=float(np.median(rmse / np.sqrt(bound))),
        missing=float(missing.mean()),
    )


def _never_constant(v: Array) -> bool:
    return bool(np.mean(np.diff(v) != 0) > 0.5)
