"""Smoothed poses: from all of a recording, or with a fixed lag."""

import math

import numpy as np

from dropanchor_service.estimation.columns import Array, Frame, State, StateReason
from dropanchor_service.estimation.fleet.belief.heading_models import reference_error
from dropanchor_service.estimation.fleet.belief.heading_reference import adopt_reference
from dropanchor_service.estimation.fleet.belief.layout import (
    DRIFTING,
    MAGNETOMETER_MODEL,
    OWN_ERROR,
    PHI,
    PLATFORM_MODEL,
    REFERENCE,
    YAW,
    V,
)
from dropanchor_service.estimation.fleet.belief.summary import add_reference_variance
from dropanchor_service.estimation.fleet.frontend.node import ABSOLUTE_HEADING, RANGE
from dropanchor_service.estimation.fleet.outputs import poses_of
from dropanchor_service.estimation.fleet.smoother.lag import all_to_planar, smooth_lagged
from dropanchor_service.estimation.fleet.smoother.lineage import trace_lineage
from dropanchor_service.estimation.fleet.smoother.smoother import smooth
from dropanchor_service.estimation.fleet.smoother.trace import TracingEngine
from dropanchor_service.estimation.fleet.smoother.track import Track, make_track
from dropanchor_service.estimation.fleet.tuning import Tuning

ITERATIONS = 20
UNKNOWN_ANGLE = 1.0  # rad, spread of the prior around where a track with unknown start began
UNKNOWN_SPEED = 2.0  # m/s
RESOLVED = (State.TRACKING, State.COASTING, State.DEGRADED)


def smoothed_poses(engine: TracingEngine, row: int, lag: float | None) -> Array:
    """Return the engine's POSE with x, y, heading, speed and covariance smoothed.

    lag: s of later data that each pose may use; None: all. The belief at the end of that data decides about the mode:
    where it is resolved, an ambiguous pose becomes `tracking`. What cannot be smoothed stays as the filter gave it.
    """
    nodes, beliefs, traces = engine.traced(row)
    chosen = nodes["kind"] == RANGE
    poses: Array = poses_of(nodes, beliefs)
    if not len(poses) or traces["count"][-1] == 0:
        return poses
    now = engine.row(row)
    if lag is None:
        points, covs = _all(nodes, traces, now, engine.anchors, engine.tuning)
        seen = np.full(len(nodes), len(nodes) - 1)
    else:
        points, covs = _lagged(nodes, traces, now, engine.anchors, engine.tuning, lag)
        seen = np.searchsorted(nodes["t_ns"], nodes["t_ns"] + round(lag * 1e9) + 1000, side="right") - 1
    if lag is None:
        poses["frame"][np.isfinite(points[chosen, 0])] = 1 - now["heading"]["in_site_frame"][0]
    _put(poses, points[chosen], covs[chosen], beliefs[seen[chosen]], now[0], engine.anchors)
    return poses


def _lagged(nodes: Array, traces: Array, now: Array, anchors: Array, t: Tuning, lag: float) -> tuple[Array, Array]:
    """Return points (n, 4): x, y from the anchor, course, speed; and covs (n, 3, 3). NaN where there is no belief."""
    points, covs = np.empty((len(nodes), 4)), np.empty((len(nodes), 3, 3))
    most = np.searchsorted(nodes["t_ns"], nodes["t_ns"] + round((lag + 1.0) * 1e9)) - np.arange(len(nodes))
    smooth_lagged(make_track(int(most.max()) + 1), nodes, traces, lag, now.copy(), anchors, t, points, covs)
    return points, covs


def _all(nodes: Array, traces: Array, now: Array, anchors: Array, t: Tuning) -> tuple[Array, Array]:
    """Return what `_lagged` does, from all data since the engine last started."""
    points, covs = np.full((len(nodes), 4), np.nan), np.full((len(nodes), 3, 3), np.nan)
    first = int(np.flatnonzero(traces["count"] == 0).max(initial=-1)) + 1
    nodes, traces = nodes[first:], traces[first:]
    track = make_track(len(nodes))
    origin = trace_lineage(nodes, traces, track.reference, track.nlos)
    heading_class = int(traces["heading_class"][-1, 0])
    _set_prior(track, traces, max(origin, 0), now[0], _reference_variance(nodes, traces, now[0], heading_class, t))
    likelihood = smooth(track, nodes, now, anchors, heading_class, t, False, ITERATIONS)
    if math.isfinite(likelihood):
        all_to_planar(track.smooth, track.smooth_cov, points[first:], covs[first:])
    return points, covs


def _reference_variance(nodes: Array, traces: Array, now: Array, heading_class: int, t: Tuning) -> float:
    """Return the variance, rad^2, of the heading reference's error by the model at the end."""
    if heading_class == DRIFTING:
        return 0.0
    absolute = nodes["heading_var"][nodes["heading_kind"] == ABSOLUTE_HEADING]
    model = int(now["heading"]["model"])
    claimed = float(absolute[0]) if model == MAGNETOMETER_MODEL and len(absolute) else 0.0
    slow = (
        reference_error(now, claimed)[1]
        if model != PLATFORM_MODEL
        else float(traces["cov"][0, 0, REFERENCE, REFERENCE]) ** 0.5
    )
    return slow**2 + (t.own_error_std**2 if heading_class == OWN_ERROR and model != PLATFORM_MODEL else 0.0)


def _set_prior(track: Track, traces: Array, origin: int, now: Array, reference_variance: float) -> None:
    """Set the prior to the hypothesis that began the lineage.

    With an unknown start, bearing, speed and yaw are those that were found, with a wide variance. Where yaw counts from
    a magnetometer later on, it does so from the beginning.
    """
    mean, cov, found = traces["mean"][0, origin].copy(), traces["cov"][0, origin].copy(), track.reference[0]
    if (
        now["start"]["known"] == 1
        and now["heading"]["model"] == MAGNETOMETER_MODEL
        and traces["model"][0] != MAGNETOMETER_MODEL
    ):
        adopt_reference(cov, UNKNOWN_ANGLE**2)
        cov[REFERENCE, :] = cov[:, REFERENCE] = 0.0
    cov[REFERENCE, REFERENCE] = max(cov[REFERENCE, REFERENCE], reference_variance)
    if now["start"]["known"] == 0:
        mean[[PHI, V]] = found[[PHI, V]]
        if now["heading"]["in_site_frame"] == 1:  # otherwise the course at the start is the x axis
            mean[YAW] = found[YAW]
        cov[PHI, PHI] += UNKNOWN_ANGLE**2
        cov[V, V] += UNKNOWN_SPEED**2
        if traces["referred"][0] != now["heading"]["in_site_frame"]:
            cov[YAW, YAW] += UNKNOWN_ANGLE**2
    for angle in (PHI, YAW):
        mean[angle] = found[angle] + math.remainder(mean[angle] - found[angle], 2.0 * math.pi)
    track.mean[0], track.cov[0] = mean, cov


def _put(poses: Array, points: Array, covs: Array, seen: Array, now: Array, anchors: Array) -> None:
    """Put the smoothed numbers into the poses. seen: BELIEF at the end of the data of each."""
    good = np.isfinite(points).all(axis=1) & np.isfinite(covs).all(axis=(1, 2))
    for k in np.flatnonzero(good & (poses["frame"] == Frame.SITE)):
        if now["start"]["known"] == 0:
            add_reference_variance(covs[k], points[k, 0], points[k, 1], float(now["settings"]["reference_std"]) ** 2)
    anchor = anchors[now["anchor"]]
    poses["x"][good], poses["y"][good] = points[good, 0] + anchor["x"], points[good, 1] + anchor["y"]
    poses["heading"][good], poses["speed"][good] = points[good, 2], points[good, 3]
    poses["cov"][good] = covs[good]
    poses["sigma_pos"][good] = np.sqrt(covs[good, 0, 0] + covs[good, 1, 1])
    poses["p_mode"][good] = seen["p_mode"][good]
    resolved = good & np.isin(seen["state"], RESOLVED) & (poses["state"] == State.AMBIGUOUS)
    poses["state"][resolved], poses["reason"][resolved] = State.TRACKING, StateReason.RESOLVED
    unsure = good & (seen["state"] == State.AMBIGUOUS)
    poses["state"][unsure], poses["reason"][unsure] = State.AMBIGUOUS, StateReason.SEVERAL_MODES
