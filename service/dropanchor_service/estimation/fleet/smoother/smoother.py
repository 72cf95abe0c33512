"""Iterated Kalman smoother of one hypothesis over all nodes, with the state and models of the belief.

About a reference track x~ every node is linear,  x_k = f(x~_{k-1}) + A_k (x_{k-1} - x~_{k-1}) + q_k,  and so is every
measurement,  z = h(x~_k) + H (x_k - x~_k) + r.  A forward Kalman filter and the backward recursion of Bryson and
Frazier (Bierman 1973, "Fixed interval smoothing with discrete measurements", eq. 20-24; as Rauch-Tung-Striebel, with no
inverse, so states without noise do no harm) give the smoothed track; it becomes the next reference. This is
Gauss-Newton on the posterior of the whole track (Bell 1994, "The iterated Kalman smoother as a Gauss-Newton method").

    forward   P- = A P A^T + Q,  S = H P- H^T + R,  x += P- H e / S,  P = P- - P- H H^T P- / S
    backward  l~ = l - H (H^T P- l + e) / S,  L~ = (I - K H^T)^T L (I - K H^T) + H H^T / S,  l = A^T l~,  L = A^T L~ A
    smoothed  x - P l,  P - P L P

A range is clear, too long by about the outlier's mean, or nonsense: the probabilities come from the forward innovation
at first, then from the smoothed residual (expectation-maximisation), and weight the range's information.
"""

import math
from typing import Final

import numpy as np

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.carried import widen_at_change
from dropanchor_service.estimation.fleet.belief.layout import (
    PHI,
    RANGE_BIAS,
    Anchors,
    Floats,
    N,
    R,
    Row,
    Rows,
)
from dropanchor_service.estimation.fleet.belief.measurements import range_variance
from dropanchor_service.estimation.fleet.belief.predict import (
    add_process_noise,
    fill_class_noise,
    fill_noise,
    predict_covariance,
    predict_state,
)
from dropanchor_service.estimation.fleet.belief.update import gaussian, predict_range, project
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import BEARING, RANGE, Node, Nodes
from dropanchor_service.estimation.fleet.smoother.inertial import measure, update_inertial
from dropanchor_service.estimation.fleet.smoother.products import apply, dot, multiply
from dropanchor_service.estimation.fleet.smoother.track import Track
from dropanchor_service.estimation.fleet.tuning import Tuning

BEARING_STD: Final = 0.1  # rad, of a bearing whose std is not told
NLOS_STD: Final = 1.1  # m, of a range offset that appears or goes: the outlier's mean and spread
CONVERGED: Final = 1e-3  # m


@njit(nogil=True)
def noise_of(node: Node, row: Row, heading_class: int, t: Tuning, decay: Floats, growth: Floats) -> None:
    """Decay of the states over the node and the variances it adds, as in the filter."""
    fill_noise(decay, growth, node, row, t)
    fill_class_noise(decay, growth, node, row, heading_class, t)


@njit(nogil=True)
def _predict(
    track: Track,
    k: int,
    nodes: Nodes,
    row: Row,
    heading_class: int,
    t: Tuning,
    scratch: tuple[Floats, Floats, Floats],
) -> None:
    node = nodes[k]
    changes = node.carried != nodes[k - 1].carried
    growth, s, A = scratch
    F, decay, m, P = track.F[k], track.decay[k], track.mean[k], track.cov[k]
    noise_of(node, row, heading_class, t, decay, growth)
    s[:] = track.reference[k - 1]
    d = track.mean[k - 1] - s
    predict_state(s, node, decay, F)
    m[:] = s
    for j in range(N):
        for i in range(4):
            m[i] += F[i, j] * d[j]
    for j in range(4, N):
        m[j] += decay[j] * d[j]
    P[:] = track.cov[k - 1]
    predict_covariance(P, F, decay, A)
    add_process_noise(s, P, F, growth, node, row, t, track.nlos[k])
    if track.nlos[k] != track.nlos[k - 1]:
        P[RANGE_BIAS, RANGE_BIAS] += NLOS_STD**2
    if changes:
        widen_at_change(P, t)


@njit(nogil=True)
def range_residual(s: Floats, node: Node, row: Row, anchors: Anchors, H: Floats) -> tuple[float, float]:
    """Return z - h(s), m, and the variance, m^2, of a range with line of sight. Fill H with dh/ds."""
    anchor, primary, settings = anchors[node.anchor], anchors[row.anchor], row.settings
    ox, oy, dz = anchor.x - primary.x, anchor.y - primary.y, settings.height - anchor.z
    predicted = predict_range(s, ox, oy, dz, node.lag_s, settings.range_scale, settings.range_bias, H)
    return node.z - predicted, range_variance(row, node, anchor)


@njit(nogil=True)
def fill_shares(share: Floats, e2: float, e: float, clear: float, long: float, t: Tuning) -> float:
    """Fill the probabilities that a range is clear and that it is too long. Return the log likelihood.

    e2: expected e^2; clear, long: the variances of the two.
    """
    spread = e2 - e * e
    inside = (1.0 - t.outlier_probability) * gaussian(math.sqrt(max(e2, 0.0)), clear)
    outside = t.outlier_probability * gaussian(math.sqrt((e - t.outlier_mean) ** 2 + spread), long)
    total = inside + outside + t.outlier_probability * t.outlier_floor
    share[0], share[1] = inside / total, outside / total
    return math.log(total)


@njit(nogil=True)
def _range(track: Track, k: int, node: Node, row: Row, anchors: Anchors, t: Tuning, follow: bool, H: Floats) -> float:
    e, variance = range_residual(track.reference[k], node, row, anchors, H)
    innovation = e
    for i in range(N):
        innovation -= H[i] * (track.mean[k, i] - track.reference[k, i])
    S = project(track.cov[k], H, track.PH[k, track.used[k]]) + variance
    share = np.zeros(2)
    likelihood = fill_shares(share, innovation**2, innovation, S, S + t.outlier_std**2, t)
    if follow:
        track.share[k] = share
    clear = track.share[k, 0] / variance
    long = track.share[k, 1] / (variance + t.outlier_std**2)
    if clear + long > 1e-6:
        measure(track, k, H, e - t.outlier_mean * long / (clear + long), 1.0 / (clear + long))
    return likelihood


@njit(nogil=True)
def _bearing(track: Track, k: int, node: Node, row: Row, anchors: Anchors, H: Floats) -> None:
    anchor, primary, s = anchors[node.anchor], anchors[row.anchor], track.reference[k]
    c, sn = math.cos(s[PHI]), math.sin(s[PHI])
    dx, dy = s[R] * c - (anchor.x - primary.x), s[R] * sn - (anchor.y - primary.y)
    d2 = max(dx * dx + dy * dy, 1e-6)
    H[:] = 0.0
    H[R] = (dx * sn - dy * c) / d2
    H[PHI] = s[R] * (dx * c + dy * sn) / d2
    std = node.z_std if math.isfinite(node.z_std) and node.z_std > 0.0 else BEARING_STD
    measure(track, k, H, wrap(node.z - math.atan2(dy, dx)), std * std)


@njit(nogil=True)
def forward(
    track: Track, nodes: Nodes, row: Row, anchors: Anchors, heading_class: int, t: Tuning, follow: bool
) -> float:
    """Filter about the reference, or about the filter itself with `follow`. Return the log likelihood."""
    scratch = (np.zeros(N), np.zeros(N), np.zeros((4, N)))
    H = np.zeros(N)
    likelihood = 0.0
    for k in range(1, len(nodes)):
        node = nodes[k]
        if follow:
            track.reference[k - 1] = track.mean[k - 1]
        _predict(track, k, nodes, row, heading_class, t, scratch)
        if follow:
            track.reference[k] = track.mean[k]
        track.used[k] = 0
        update_inertial(track, k, node, row, heading_class, t, H)
        if node.kind == RANGE:
            likelihood += _range(track, k, node, row, anchors, t, follow, H)
        elif node.kind == BEARING:
            _bearing(track, k, node, row, anchors, H)
    return likelihood


@njit(nogil=True)
def _step_back_over_measurement(H: Floats, PH: Floats, S: float, e: float, costate: Floats, L: Floats) -> None:
    """Step the costate l and its covariance L back over one scalar measurement."""
    g = apply(L, PH) / S
    c = (dot(PH, g) + 1.0) / S
    pull = (dot(PH, costate) + e) / S
    for i in range(N):
        costate[i] -= H[i] * pull
        for j in range(N):
            L[i, j] += H[i] * H[j] * c - H[i] * g[j] - g[i] * H[j]


@njit(nogil=True)
def backward(track: Track, n: int) -> None:
    """Fill smooth and smooth_cov of the first n nodes from the result of `forward`."""
    costate, L, A = np.zeros(N), np.zeros((N, N)), np.zeros((N, N))
    for k in range(n - 1, -1, -1):
        P = track.cov[k]
        track.smooth[k] = track.mean[k] - apply(P, costate)
        track.smooth_cov[k] = P - multiply(P, multiply(L, P))
        for m in range(track.used[k] - 1, -1, -1):
            _step_back_over_measurement(track.H[k, m], track.PH[k, m], track.S[k, m], track.e[k, m], costate, L)
        A[:] = 0.0
        A[:4] = track.F[k]
        for i in range(4, N):
            A[i, i] = track.decay[k, i]
        costate[:] = apply(A.T, costate)
        L[:] = multiply(A.T, multiply(L, A))


@njit(nogil=True)
def _relinearise(track: Track, nodes: Nodes, row: Row, anchors: Anchors, t: Tuning) -> float:
    """Make the smoothed track the reference and update the shares of its ranges. Return the largest step, m."""
    H, PH = np.zeros(N), np.zeros(N)
    largest = 0.0
    for k in range(len(nodes)):
        s, old, node = track.smooth[k], track.reference[k], nodes[k]
        step = math.hypot(s[R] - old[R], old[R] * (s[PHI] - old[PHI]))
        largest = max(largest, step)
        old[:] = s
        old[R] = max(old[R], 1e-3)
        if k > 0 and node.kind == RANGE:
            e, variance = range_residual(old, node, row, anchors, H)
            e2 = e * e + project(track.smooth_cov[k], H, PH)
            fill_shares(track.share[k], e2, e, variance, variance + t.outlier_std**2, t)
    return largest


@njit(nogil=True, cache=True)
def smooth(
    track: Track,
    nodes: Nodes,
    rows: Rows,
    anchors: Anchors,
    heading_class: int,
    t: Tuning,
    follow: bool,
    iterations: int,
) -> float:
    """Iterate from the reference, or from a filter's track with `follow`. Return the log likelihood of the ranges."""
    row = rows[0]
    likelihood = -math.inf
    for i in range(iterations):
        likelihood = forward(track, nodes, row, anchors, heading_class, t, follow and i == 0)
        backward(track, len(nodes))
        if _relinearise(track, nodes, row, anchors, t) < CONVERGED:
            break
    return likelihood
