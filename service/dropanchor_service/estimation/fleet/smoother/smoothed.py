"""Smoothed poses, from all of a recording or with a fixed lag. They claim no more than the filtered ones.

With F the covariance of the filter and S that of the smoother, F - S is what later samples tell, if the models hold.
Errors that the models leave out last, are in both, and do not shrink. Therefore

- ellipse and state stay those of the filter. Where it had several modes, later samples left one, and not always the
  right one: the pose moves to that mode and stays `ambiguous`;
- the mean is that of covariance intersection (Julier and Uhlmann 1997) of equal weights, which holds under any
  correlation of the two.

The filtered pose stays where nothing `tracking` follows, where S is larger than F, as later samples then tell less than
earlier ones, and where the two contradict each other.
"""

from typing import Final, NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array, Frame, State
from dropanchor_service.estimation.fleet.belief.heading_models import reference_std
from dropanchor_service.estimation.fleet.belief.summary import add_reference_variance
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.frontend.node import RANGE
from dropanchor_service.estimation.fleet.outputs import poses_of
from dropanchor_service.estimation.fleet.smoother.lineage import smooth_back
from dropanchor_service.estimation.fleet.smoother.trace import Run, TracingEngine

STRIDE: Final = 0.25  # of the lag: nodes so close together share the end of their data
WALK_LAG: Final = 3.0  # s of later data at most, of a carried tag: all its hypotheses come from one of before
CONTRADICTED: Final = 18.4  # chi-square of two degrees of freedom, x and y, exceeded once in 10,000
WEIGHT: Final = 0.5  # of a smoothed pose beside the filtered one
LEAST: Final = 1e-12  # m^2 and rad^2, so that no covariance is singular


class SmoothedPoses(NamedTuple):
    """The poses of a track, and which of them are smoothed: the others are as the filter gave them."""

    poses: Array  # POSE (n,)
    used: Array  # bool (n,)


def smoothed_poses(engine: TracingEngine, row: int, lag: float | None) -> SmoothedPoses:
    """Return the engine's POSE, those that are better from later samples with x, y, heading and speed smoothed.

    lag: s of later data that each pose may use; None: all. Of a carried tag that is `WALK_LAG` at most.
    """
    run = engine.traced(row)
    poses: Array = poses_of(run.nodes, run.beliefs)
    if not len(poses):
        return SmoothedPoses(poses, np.zeros(0, np.bool_))
    points, covs = _smooth(engine, run, row, lag)
    chosen = run.nodes["kind"] == RANGE
    used = _put(poses, points[chosen], covs[chosen], engine.row(row)[0], engine.anchors)
    return SmoothedPoses(poses, used)


def _smooth(engine: TracingEngine, run: Run, row: int, lag: float | None) -> tuple[Array, Array]:
    """Return x, y from the anchor, course and speed (n, 4), and covariances (n, 3, 3). NaN: no later one is trusted."""
    n, now = len(run.nodes), engine.row(row)
    points, covs = np.full((n, 4), np.nan), np.full((n, 3, 3), np.nan)
    if now["anchor"][0] < 0:
        return points, covs
    anchor = engine.anchors[now["anchor"][0]]
    published = np.stack([run.beliefs["x"] - anchor["x"], run.beliefs["y"] - anchor["y"]], axis=1)
    trusted, space = run.beliefs["state"] == State.TRACKING, make_workspace()
    of_run = space, run.nodes, run.traces, run.hypotheses, published, trusted
    for span in _spans(run.nodes["t_ns"], run.traces["carried"], lag):
        smooth_back(*of_run, span, now, engine.tuning, points, covs)
    return points, covs


def _spans(t_ns: Array, carried: Array, lag: float | None) -> list[tuple[int, int, int]]:
    """Return the first node, the one after the last, and the last node of the data, of nodes that share that data."""
    spans, a = [], 0
    changes = np.flatnonzero(np.diff(carried)) + 1
    for stop in (*changes.tolist(), len(t_ns)):
        own = min(np.inf if lag is None else lag, WALK_LAG if carried[a] else np.inf)
        while a < stop:
            end, b = stop - 1, stop
            if np.isfinite(own):
                end = min(int(np.searchsorted(t_ns, t_ns[a] + round(own * 1e9) + 1000, side="right")) - 1, end)
                b = int(np.searchsorted(t_ns, t_ns[a] + round(STRIDE * own * 1e9), side="right"))
            spans.append((a, min(b, end + 1), end))
            a = spans[-1][1]
    return spans


def _put(poses: Array, points: Array, covs: Array, now: Array, anchors: Array) -> Array:
    """Put the smoothed numbers into the poses that they are better than, and return which those are."""
    good = np.isfinite(points).all(axis=1) & np.isfinite(covs).all(axis=(1, 2)) & np.isfinite(poses["x"])
    for k in np.flatnonzero(good & (poses["frame"] == Frame.SITE)):
        if now["start"]["known"] == 0:
            add_reference_variance(covs[k], points[k, 0], points[k, 1], reference_std(now) ** 2)
    anchor = anchors[now["anchor"]]
    points[:, 0] += anchor["x"]
    points[:, 1] += anchor["y"]
    filtered = np.stack([poses["x"], poses["y"], poses["heading"]], axis=1)
    good[good] = _is_allowed(points[good], covs[good], filtered[good], poses["cov"][good])
    found = _intersect(filtered[good], poses["cov"][good], points[good, :3], covs[good])
    poses["x"][good], poses["y"][good], poses["heading"][good] = found.T
    poses["speed"][good] = points[good, 3]
    return np.asarray(good)


def _is_allowed(points: Array, covs: Array, filtered: Array, allowing: Array) -> Array:
    """Return whether later samples tell more than earlier ones, and do not contradict them."""
    d, F = points[:, :2] - filtered[:, :2], allowing[:, :2, :2]
    squared = np.einsum("ni,ni->n", d, np.linalg.solve(F, d[:, :, None])[:, :, 0])
    return np.asarray((squared < CONTRADICTED) & (np.linalg.det(covs[:, :2, :2]) <= np.linalg.det(F)))


def _intersect(filtered: Array, wide: Array, points: Array, covs: Array) -> Array:
    """Return x, y and course (n, 3), fused with the filtered ones by covariance intersection."""
    least = LEAST * np.eye(3)
    later = WEIGHT * np.linalg.inv(covs + least)
    both = (1.0 - WEIGHT) * np.linalg.inv(wide + least) + later
    d = points - filtered
    d[:, 2] = np.remainder(d[:, 2] + np.pi, 2.0 * np.pi) - np.pi
    found = filtered + np.linalg.solve(both, later @ d[:, :, None])[:, :, 0]
    found[:, 2] = np.remainder(found[:, 2] + np.pi, 2.0 * np.pi) - np.pi
    return np.asarray(found)
