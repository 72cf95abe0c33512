"""Error of a track against ground truth, and the consistency of its ellipses and states."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dropanchor_service.answers.kernels.ageing import CHI2_95_OF_2
from dropanchor_service.estimation.columns import Array, State

MAX_TRUTH_GAP_S = 1.0
_STATES = [state.name.lower() for state in State]


@dataclass(frozen=True)
class Truth:
    """Ground truth: t in s, x and y in m, all of shape (n,), t strictly increasing."""

    t: Array
    x: Array
    y: Array


@dataclass(frozen=True)
class Accuracy:
    """Position error in m, over the poses with a position and a truth.

    rmse and the quantiles are without alignment. rmse_rotated: after the best rotation about the anchor, which ranges
    alone cannot observe. ate: absolute trajectory error, after the best rigid motion (Horn 1987).
    coverage: share of poses whose 95 % ellipse contains the truth. share_of_time: by state, over the whole track.
    rmse_tracking: RMSE of the poses in state tracking; NaN without any.
    """

    compared: int
    rmse: float
    mean: float
    median: float
    p95: float
    worst: float
    rmse_rotated: float
    ate: float
    rmse_tracking: float
    coverage: float
    share_of_time: dict[str, float]


def truth_at(truth: Truth, t: Array) -> tuple[Array, Array]:
    """Return x and y of the truth at the times t (n,) by linear interpolation; NaN outside it and in gaps > 1 s."""
    after = np.clip(np.searchsorted(truth.t, t), 1, len(truth.t) - 1)
    bridged = (truth.t[after] - truth.t[after - 1] <= MAX_TRUTH_GAP_S) | (truth.t[after] == t)
    inside = (t >= truth.t[0]) & (t <= truth.t[-1]) & bridged
    x = np.where(inside, np.interp(t, truth.t, truth.x), np.nan)
    y = np.where(inside, np.interp(t, truth.t, truth.y), np.nan)
    return x, y


def accuracy(t: Array, poses: Array, truth: Truth, anchor: tuple[float, float]) -> Accuracy:
    """Compare POSE rows at the times t (n,), s on the clock of the truth, with the truth.

    Raises ValueError if no pose has both a position and a truth.
    """
    x, y = truth_at(truth, t)
    used = np.isfinite(poses["x"]) & np.isfinite(poses["y"]) & np.isfinite(x)
    if not used.any():
        raise ValueError("no pose has a position at a time for which there is truth")
    found = np.column_stack([poses["x"], poses["y"]])[used]
    true = np.column_stack([x, y])[used]
    error = np.hypot(*(found - true).T)
    tracking = poses["state"][used] == State.TRACKING
    return Accuracy(
        compared=int(used.sum()),
        rmse=_rms(error),
        mean=float(error.mean()),
        median=float(np.median(error)),
        p95=float(np.quantile(error, 0.95)),
        worst=float(error.max()),
        rmse_rotated=_rms_aligned(found, true, np.asarray(anchor), np.asarray(anchor)),
        ate=_rms_aligned(found, true, found.mean(axis=0), true.mean(axis=0)),
        rmse_tracking=_rms(error[tracking]) if tracking.any() else float("nan"),
        coverage=_coverage(found - true, poses["cov"][used][:, :2, :2]),
        share_of_time=share_of_time(t, poses["state"]),
    )


def share_of_time(t: Array, states: Array, names: Sequence[str] = _STATES) -> dict[str, float]:
    """Return by state its share of the time between the first and the last pose. names: of all states, in order.

    Without `names` the states are those of the engine, for which the frame of a pose does not matter.
    """
    spent = np.diff(t, append=t[-1])
    total = spent.sum()
    return {
        name: float(spent[states == state].sum() / total) if total > 0 else 1.0
        for state, name in enumerate(names)
        if (states == state).any()
    }


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def _rms_aligned(found: Array, true: Array, pivot_found: Array, pivot_true: Array) -> float:
    """Return the RMS distance after the rotation about the pivots that minimises it (closed form in the plane)."""
    a, b = found - pivot_found, true - pivot_true
    angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return _rms(np.hypot(*(a @ rotation.T - b).T))


def nees(error: Array, cov: Array) -> Array:
    """Return the normalised squares of errors (n, 2) for their covariance (n, 2, 2); NaN if that is singular."""
    det = cov[:, 0, 0] * cov[:, 1, 1] - cov[:, 0, 1] ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        squared = (
            cov[:, 1, 1] * error[:, 0] ** 2
            - 2 * cov[:, 0, 1] * error[:, 0] * error[:, 1]
            + cov[:, 0, 0] * error[:, 1] ** 2
        ) / det
    return np.where(det > 0, squared, np.nan)


def _coverage(error: Array, cov: Array) -> float:
    """Return the share of errors (n, 2) in the 95 % ellipse of their covariance (n, 2, 2); singular ones are empty."""
    return float(np.mean(nees(error, cov) <= CHI2_95_OF_2))
