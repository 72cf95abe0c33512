"""The fixed-lag track: what the next seconds say about the hypotheses of the filter.

Each hypothesis kept of a node is carried over the nodes of the lag, smoothed back, and weighted by the likelihood of
the ranges: the posterior of that instant given the data up to `lag` later, no more. Nodes within STRIDE share a window.
"""

import math
from typing import Final

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.layout import Anchors, Floats, Rows, V
from dropanchor_service.estimation.fleet.belief.summary import course_of, planar_covariance
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Nodes
from dropanchor_service.estimation.fleet.smoother.smoother import smooth
from dropanchor_service.estimation.fleet.smoother.trace import TRACED
from dropanchor_service.estimation.fleet.smoother.track import Track
from dropanchor_service.estimation.fleet.tuning import Tuning

STRIDE: Final = 0.095  # s
DEPTH: Final = 6.0  # log weight below the best at which a hypothesis is not carried
ITERATIONS: Final = 3


@njit(nogil=True)
def to_planar(s: Floats, P: Floats, point: Floats, cov: Floats) -> None:
    """Fill point (x, y from the anchor, course, speed) and cov (3, 3) of x, y, course."""
    point[0], point[1] = s[0] * math.cos(s[1]), s[0] * math.sin(s[1])
    point[2], point[3] = course_of(s), s[V]
    planar_covariance(s, P, cov)


@njit(nogil=True, cache=True)
def all_to_planar(means: Floats, covs: Floats, points: Floats, out: Floats) -> None:
    """`describe` for every node."""
    for k in range(len(means)):
        to_planar(means[k], covs[k], points[k], out[k])


@njit(nogil=True)
def _mix_mode(weights: Floats, points: Floats, covs: Floats, point: Floats, cov: Floats) -> None:
    """Fill point and cov with the moments of the mode of the heaviest: all within 1 m + 2 sigma of it."""
    head = np.argmax(weights)
    spread = math.sqrt(max(covs[head, 0, 0] + covs[head, 1, 1], 0.0))
    total = 0.0
    point[:] = 0.0
    cov[:] = 0.0
    for j in range(len(weights)):
        d = points[j] - points[head]
        d[2] = wrap(d[2])
        if math.hypot(d[0], d[1]) <= 1.0 + 2.0 * spread:
            total += weights[j]
            point += weights[j] * d
            cov += weights[j] * (covs[j] + np.outer(d[:3], d[:3]))
    point /= total
    cov /= total
    cov -= np.outer(point[:3], point[:3])
    point += points[head]
    point[2] = wrap(point[2])


@njit(nogil=True)
def _has_one_model(traces: Array) -> bool:
    """Return whether the window has hypotheses throughout, with one model of the heading error and one north."""
    for k in range(1, len(traces)):
        if traces[k].model != traces[0].model or traces[k].referred != traces[0].referred or traces[k].count == 0:
            return False
        if traces[k].north != traces[0].north:
            return False
    return bool(traces[0].count > 0)


@njit(nogil=True)
def _smooth_window(
    track: Track,
    nodes: Nodes,
    traces: Array,
    block: int,
    rows: Rows,
    anchors: Anchors,
    t: Tuning,
    points: Floats,
    covs: Floats,
) -> None:
    """Fill points (n, 4) and covs (n, 3, 3) of the first `block` nodes."""
    first = traces[0]
    weights = np.full(TRACED, -math.inf)
    own, own_cov = np.zeros((block, TRACED, 4)), np.zeros((block, TRACED, 3, 3))
    rows[0].heading.model, rows[0].heading.north = first.model, first.north
    for j in range(first.count):
        if first.log_weight[j] < first.log_weight[0] - DEPTH:
            continue
        track.mean[0], track.cov[0] = first.mean[j], first.cov[j]
        track.nlos[:] = first.nlos[j]
        likelihood = smooth(track, nodes, rows, anchors, first.heading_class[j], t, True, ITERATIONS)
        if math.isfinite(likelihood):
            weights[j] = first.log_weight[j] + t.likelihood_power * likelihood
        for k in range(block):
            to_planar(track.smooth[k], track.smooth_cov[k], own[k, j], own_cov[k, j])
    if np.max(weights) > -math.inf:
        shares = np.exp(weights - np.max(weights))
        used = shares > 0.0
        for k in range(block):
            _mix_mode(shares[used], own[k][used], own_cov[k][used], points[k], covs[k])


@njit(nogil=True, cache=True)
def smooth_lagged(
    track: Track,
    nodes: Nodes,
    traces: Array,
    lag: float,
    rows: Rows,
    anchors: Anchors,
    t: Tuning,
    points: Floats,
    covs: Floats,
) -> None:
    """Fill points (n, 4) and covs (n, 3, 3). They are NaN where there is no belief, or its heading model changed."""
    points[:] = np.nan
    covs[:] = np.nan
    a = 0
    while a < len(nodes):
        start = nodes[a].t_ns
        b = a
        while b < len(nodes) and (nodes[b].t_ns - start) * 1e-9 < STRIDE:
            b += 1
        end = b
        while end < len(nodes) and (nodes[end].t_ns - start) * 1e-9 <= lag + 1e-6:
            end += 1
        if _has_one_model(traces[a:end]):
            _smooth_window(track, nodes[a:end], traces[a:end], b - a, rows, anchors, t, points[a:b], covs[a:b])
        a = b
