"""The smoother against dense least squares and the textbook recursion of Rauch, Tung and Striebel."""

import math
from typing import Any

import numpy as np

from dropanchor_service.estimation.columns import default_settings
from dropanchor_service.estimation.fleet.belief.layout import ACC_BIAS, RANGE_BIAS, ROW, N, R, V
from dropanchor_service.estimation.fleet.belief.workspace import WORKING_HYPOTHESIS, make_workspace
from dropanchor_service.estimation.fleet.configure import configure_row
from dropanchor_service.estimation.fleet.frontend.node import NODE, RANGE
from dropanchor_service.estimation.fleet.smoother.back import predict_moments, set_row, step_back
from dropanchor_service.estimation.fleet.smoother.trace import TRACE
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.fleet_runs import traced
from support.fleet_tracks import CALIBRATED

RADIAL = [R, V, ACC_BIAS, RANGE_BIAS]
SCRATCH = make_workspace()[0]["scratch"]
RANGE_STD, Q_RANGE_BIAS = 0.1, 1e-5  # m, m^2/s
PRIOR = ([10.0, 1.0, 0.0, 0.0], [0.04, 0.09, 0.01, 0.02])


def radial_nodes(n: int = 60, dt: float = 0.05) -> Any:
    """Return nodes of a tag that drives straight away from the anchor: range, speed and both biases are then linear."""
    rng = np.random.default_rng(7)
    nodes = np.zeros(n, NODE)
    nodes["dt_s"], nodes["t_ns"] = dt, np.arange(n) * round(dt * 1e9)
    nodes["dv_forward"], nodes["dv_var"] = 0.02 * rng.standard_normal(n), 4e-4
    nodes["kind"], nodes["z_std"] = RANGE, 0.1
    nodes["z"] = 10.0 + 1.3 * dt * np.arange(n) + 0.1 * rng.standard_normal(n)
    return nodes


def radial_row(tuning: Tuning) -> Any:
    columns = default_settings()
    columns["mount_angle"], columns["range_std"] = 0.0, RANGE_STD
    columns["range_bias_std"] = math.sqrt(Q_RANGE_BIAS * tuning.range_bias_tau / 2)
    row = np.zeros(1, ROW)
    row[:] = configure_row(columns, tuning)
    row["anchor"] = 0
    return row


def model(nodes: Any, t: Tuning) -> tuple[Any, Any]:
    """Return A and the variances q of a step of the radial drive."""
    dt = float(nodes["dt_s"][0])
    decay = math.exp(-dt / t.acc_bias_tau)
    A = np.array([[1.0, dt, -dt * dt / 2, 0.0], [0.0, 1.0, -dt, 0.0], [0.0, 0.0, decay, 0.0], [0.0, 0.0, 0.0, 1.0]])
    acc_var = t.acc_bias_std**2 + t.acc_bias_roughness * 4e-4 / dt
    return A, [t.q_position * dt, 4e-4 + t.q_speed * dt, acc_var * (1 - decay**2), Q_RANGE_BIAS * dt]


def filtered(nodes: Any, t: Tuning) -> Any:
    """Return WORKING_HYPOTHESIS of every node by the linear Kalman filter."""
    (A, q), h = model(nodes, t), np.array([1.0, 0.0, 0.0, 1.0])
    x, P = np.array(PRIOR[0]), np.diag(PRIOR[1])
    kept = np.zeros(len(nodes), WORKING_HYPOTHESIS)
    for k, node in enumerate(nodes):
        if k > 0:
            f, dt = node["dv_forward"], node["dt_s"]
            x, P = A @ x + [f * dt / 2, f, 0.0, 0.0], A @ P @ A.T + np.diag(q)
            gain = P @ h / (h @ P @ h + RANGE_STD**2)
            x, P = x + gain * (node["z"] - h @ x), P - np.outer(gain, h @ P)
        kept[k]["mean"][RADIAL], kept[k]["cov"][np.ix_(RADIAL, RADIAL)] = x, P
    return kept


def stepped_back(nodes: Any, kept: Any, traces: Any, rows: Any, t: Tuning) -> tuple[Any, Any]:
    """Return the smoothed moments of one hypothesis over all nodes."""
    mean, cov = kept["mean"].copy(), kept["cov"].copy()
    for k in range(len(nodes) - 2, -1, -1):
        mean[k], cov[k] = mean[k + 1], cov[k + 1]
        set_row(rows[0], traces[k], traces[k + 1])
        moments = predict_moments(kept[k], kept[k + 1], nodes[k + 1], rows[0], traces[k + 1], False, t, SCRATCH)
        assert step_back(mean[k], cov[k], kept[k], *moments)
    return mean, cov


def least_squares(nodes: Any, t: Tuning) -> tuple[Any, Any]:
    """Return mean (n, 4) and covariance (n, 4, 4) of the radial drive, from one dense system of its equations."""
    n, dt, (A, q) = len(nodes), float(nodes["dt_s"][0]), model(nodes, t)
    rows, values = [], []

    def add(block: Any, at: int, value: Any, sd: Any) -> None:
        row = np.zeros((len(block), 4 * n))
        row[:, at : at + block.shape[1]] = block
        rows.append(row / np.asarray(sd)[:, None])
        values.append(np.asarray(value) / sd)

    add(np.eye(4), 0, PRIOR[0], np.sqrt(PRIOR[1]))
    for k in range(1, n):
        f = nodes["dv_forward"][k]
        add(np.hstack([-A, np.eye(4)]), 4 * (k - 1), [f * dt / 2, f, 0.0, 0.0], np.sqrt(q))
        add(np.array([[1.0, 0.0, 0.0, 1.0]]), 4 * k, [nodes["z"][k]], [RANGE_STD])
    J, z = np.vstack(rows), np.concatenate(values)
    cov = np.linalg.inv(J.T @ J)
    blocks = np.array([cov[4 * k : 4 * k + 4, 4 * k : 4 * k + 4] for k in range(n)])
    return np.linalg.lstsq(J, z, rcond=None)[0].reshape(n, 4), blocks


def test_on_a_linear_drive_the_result_is_the_batch_least_squares_solution_with_its_covariance() -> None:
    tuning = Tuning(range_bias_tau=2e11, q_speed=1e-4)  # so that the bias walks at random
    nodes = radial_nodes()
    kept, traces = filtered(nodes, tuning), np.zeros(len(nodes), TRACE)
    mean, cov = stepped_back(nodes, kept, traces, radial_row(tuning), tuning)
    x, P = least_squares(nodes, tuning)
    assert np.abs(mean[:, RADIAL] - x).max() < 1e-5
    assert np.abs(cov[:, RADIAL][:, :, RADIAL] - P).max() < 1e-5


def test_one_step_over_a_turn_equals_the_textbook_recursion_with_a_jacobian_by_differences() -> None:
    fleet, _, _ = traced(2000)
    run, row = fleet.traced(0), fleet.row(0)
    for k in (200, 230, 260):
        one, node = run.hypotheses[run.traces[k]["first"]], run.nodes[k + 1]
        set_row(row[0], run.traces[k], run.traces[k + 1])
        s, P, C = predict_moments(one, one, node, row[0], run.traces[k + 1], False, CALIBRATED, SCRATCH)
        A = np.zeros((N, N))
        for i in range(N):
            ends = []
            for step in (1e-5, -1e-5):
                moved = run.hypotheses[run.traces[k]["first"] : run.traces[k]["first"] + 1].copy()[0]
                moved["mean"][i] += step
                ends.append(
                    predict_moments(moved, moved, node, row[0], run.traces[k + 1], False, CALIBRATED, SCRATCH)[0]
                )
            A[:, i] = (ends[0] - ends[1]) / 2e-5
        # What an error of the gyroscope's bias turns of the two biases is left out of C.
        assert np.allclose(C, one["cov"] @ A.T, rtol=1e-4, atol=1e-5)
        mean, cov = s + 0.1 * np.sqrt(np.diag(P)), 0.5 * P
        start = mean.copy()
        assert step_back(mean, cov, one, s, P, C)
        scale = np.sqrt(np.maximum(np.diag(P), 1e-30))
        G = C @ (np.linalg.pinv(P / np.outer(scale, scale), rcond=1e-10, hermitian=True) / np.outer(scale, scale))
        assert np.allclose(mean, one["mean"] + G @ (start - s), atol=1e-5)
        assert np.allclose(cov, one["cov"] - 0.5 * G @ P @ G.T, atol=1e-6)
