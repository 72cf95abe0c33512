"""The smoother against dense least squares and the textbook recursion of Rauch, Tung and Striebel."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.columns import ANCHOR, default_settings
from dropanchor_service.estimation.fleet.belief.layout import ACC_BIAS, RANGE_BIAS, ROW, N, R, V
from dropanchor_service.estimation.fleet.configure import configure_row
from dropanchor_service.estimation.fleet.frontend.node import NODE, RANGE
from dropanchor_service.estimation.fleet.smoother.smoother import smooth
from dropanchor_service.estimation.fleet.smoother.track import Track, make_track
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.fleet_runs import traced
from support.fleet_tracks import CALIBRATED

RADIAL = [R, V, ACC_BIAS, RANGE_BIAS]
RANGE_STD, Q_RANGE_BIAS = 0.1, 1e-5  # m, m^2/s


def radial_nodes(n: int = 60, dt: float = 0.05) -> Any:
    """Return nodes of a tag that drives straight away from the anchor: range, speed and both biases are then linear."""
    rng = np.random.default_rng(7)
    nodes = np.zeros(n, NODE)
    nodes["dt_s"], nodes["t_ns"] = dt, np.arange(n) * round(dt * 1e9)
    nodes["dv_forward"], nodes["dv_var"] = 0.02 * rng.standard_normal(n), 4e-4
    nodes["kind"], nodes["z_std"] = RANGE, 0.1
    nodes["z"] = 10.0 + 1.3 * dt * np.arange(n) + 0.1 * rng.standard_normal(n)
    return nodes


def radial_track(nodes: Any, tuning: Tuning, follow: bool) -> Track:
    track = make_track(len(nodes))
    track.mean[0, [R, V]] = 10.0, 1.0
    for index, variance in zip(RADIAL, (0.04, 0.09, 0.01, 0.02), strict=True):
        track.cov[0, index, index] = variance
    track.reference[:] = track.mean[0]
    row = np.zeros(1, ROW)
    columns = default_settings()
    columns["mount_angle"], columns["range_std"] = 0.0, RANGE_STD
    columns["range_bias_std"] = math.sqrt(Q_RANGE_BIAS * tuning.range_bias_tau / 2)
    row[:] = configure_row(columns, tuning)
    row["anchor"] = 0
    smooth(track, nodes, row, np.zeros(1, ANCHOR), 0, tuning, follow, 4)
    return track


def least_squares(nodes: Any, t: Tuning) -> tuple[Any, Any]:
    """Return mean (n, 4) and covariance (n, 4, 4) of the radial drive, from one dense system of its equations."""
    n, dt = len(nodes), float(nodes["dt_s"][0])
    decay = math.exp(-dt / t.acc_bias_tau)
    A = np.array([[1.0, dt, -dt * dt / 2, 0.0], [0.0, 1.0, -dt, 0.0], [0.0, 0.0, decay, 0.0], [0.0, 0.0, 0.0, 1.0]])
    acc_var = t.acc_bias_std**2 + t.acc_bias_roughness * 4e-4 / dt
    q = [t.q_position * dt, 4e-4 + t.q_speed * dt, acc_var * (1 - decay**2), Q_RANGE_BIAS * dt]
    rows, values = [], []

    def add(block: Any, at: int, value: Any, sd: Any) -> None:
        row = np.zeros((len(block), 4 * n))
        row[:, at : at + block.shape[1]] = block
        rows.append(row / np.asarray(sd)[:, None])
        values.append(np.asarray(value) / sd)

    add(np.eye(4), 0, [10.0, 1.0, 0.0, 0.0], np.sqrt([0.04, 0.09, 0.01, 0.02]))
    for k in range(1, n):
        f = nodes["dv_forward"][k]
        add(np.hstack([-A, np.eye(4)]), 4 * (k - 1), [f * dt / 2, f, 0.0, 0.0], np.sqrt(q))
        add(np.array([[1.0, 0.0, 0.0, 1.0]]), 4 * k, [nodes["z"][k]], [RANGE_STD])
    J, z = np.vstack(rows), np.concatenate(values)
    cov = np.linalg.inv(J.T @ J)
    blocks = np.array([cov[4 * k : 4 * k + 4, 4 * k : 4 * k + 4] for k in range(n)])
    return np.linalg.lstsq(J, z, rcond=None)[0].reshape(n, 4), blocks


@pytest.mark.parametrize("follow", [True, False])
def test_on_a_linear_drive_the_result_is_the_batch_least_squares_solution_with_its_covariance(follow: bool) -> None:
    tuning = Tuning(outlier_probability=0.0, range_bias_tau=2e11)  # so that the bias walks at random
    nodes = radial_nodes()
    track = radial_track(nodes, tuning, follow)
    x, P = least_squares(nodes, tuning)
    assert np.abs(track.smooth[:, RADIAL] - x).max() < 1e-7
    assert np.abs(track.smooth_cov[:, RADIAL][:, :, RADIAL] - P).max() < 1e-8


def rauch_tung_striebel(track: Track) -> tuple[Any, Any]:
    """Return the result of the textbook recursion, from the filtered moments. Predictions follow by undoing updates."""
    n = len(track.mean)
    x, P = track.mean.copy(), track.cov.copy()
    for k in range(n - 1, 0, -1):
        x_predicted, P_predicted = track.mean[k].copy(), track.cov[k].copy()
        for m in range(track.used[k] - 1, -1, -1):
            PH, S = track.PH[k, m], track.S[k, m]
            x_predicted -= PH * track.e[k, m] / S
            P_predicted += np.outer(PH, PH) / S
        A = np.diag(track.decay[k])
        A[:4] = track.F[k]
        scale = np.sqrt(np.maximum(np.diag(P_predicted), 1e-30))
        inverse = np.linalg.pinv(P_predicted / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
        G = track.cov[k - 1] @ A.T @ inverse
        x[k - 1] += G @ (x[k] - x_predicted)
        P[k - 1] += G @ (P[k] - P_predicted) @ G.T
    return x, P


def test_it_equals_the_textbook_recursion_on_a_drive_with_turns() -> None:
    fleet, _, _ = traced(2000)
    nodes, _, traces = fleet.traced(0)
    first = int(np.flatnonzero(traces["count"] == 0).max(initial=-1)) + 1
    track = make_track(len(nodes) - first)
    track.mean[0], track.cov[0] = traces["mean"][first, 0], traces["cov"][first, 0]
    smooth(track, nodes[first:], fleet.row(0), fleet.anchors, 0, CALIBRATED, True, 1)
    x, P = rauch_tung_striebel(track)
    sd = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0))
    assert (np.abs(track.smooth - x) <= 1e-4 * sd + 1e-9).all()
    own_sd = np.sqrt(np.maximum(np.diagonal(track.smooth_cov, axis1=1, axis2=2), 0.0))
    assert np.allclose(own_sd, sd, rtol=1e-3, atol=1e-6)
    assert x.shape == (len(nodes) - first, N)
