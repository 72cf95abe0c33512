"""What the heading reference is worth: a small bank of models of its error, judged by their predictions.

Each model m is a Kalman filter over (yaw, gyro bias, slow error) with the node's yaw increment and heading; the models
differ in how much of the claimed variance is white and how much is a Gauss-Markov error (sd, time constant). A heading
whose error is white, and one that wanders for seconds, differ by much in what an average of them is worth.
"""

import math
from typing import Any

from dropanchor_service.estimation.fleet.belief.layout import COMMON, DRIFTING, MODELS, OWN_ERROR, STEADY
from dropanchor_service.estimation.fleet.belief.update import wrap
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning

COMES_AGAIN = 3.0


@njit(nogil=True)
def model_of(m: int, variance: float) -> tuple[float, float, float]:
    """(white variance, sd of the slow error, its time constant) of model m for a claimed variance.

    Model COMMON: nearly all of the variance is one slow error. Model STEADY: a platform's own, good to 0.03 rad.
    """
    if m == COMMON:
        return 0.01 * variance + 1e-5, math.sqrt(variance), 30.0
    if m == STEADY:
        return 4e-4, 0.03, 60.0
    if m == 1:
        return 0.01 * variance, 0.1, 3.0
    if m == 2:
        return variance, 0.15, 20.0
    if m == 3:
        return 0.01 * variance, 0.15, 15.0
    return variance, 0.0, 20.0


@njit(nogil=True)
def error_of(row: Any, variance: float) -> tuple[float, float, float]:
    """`model_of` the row's model; of a platform's heading, what was told of it goes before.

    Where the start's heading is given, the magnetometer has three times the error it claims: that of soft iron and
    place comes again with every lap, so it does not average out; gyroscope and ranges bound yaw better for minutes.
    """
    if not told_of(row):
        white, slow, tau = model_of(row.model, variance)
        if row.model == COMMON and row.start_known == 1 and math.isfinite(row.start_heading):
            slow *= COMES_AGAIN
        return white, slow, tau
    white, _, _ = model_of(STEADY if row.model == STEADY else 0, variance)
    return white, row.heading_std, 60.0


@njit(nogil=True)
def error_of_class(row: Any, kind: int, variance: float, t: Tuning) -> tuple[float, float, float]:
    """`error_of` for one class of hypotheses."""
    if kind == DRIFTING:
        return model_of(0, variance)
    white, slow, tau = error_of(row, variance)
    if kind == OWN_ERROR and row.model != STEADY:
        return white, math.sqrt(slow * slow + t.second_std**2), max(t.second_tau, tau)
    return white, slow, tau


@njit(nogil=True)
def told_of(row: Any) -> bool:
    """Whether the operator told the error of the heading in use."""
    return row.model != COMMON and math.isfinite(row.heading_std)


@njit(nogil=True)
def reset_models(row: Any, heading: float, variance: float, t: Tuning) -> None:
    """Start every model at this heading."""
    for m in range(MODELS):
        white, slow, _ = model_of(m, variance)
        row.hm_mean[m, 0], row.hm_mean[m, 1], row.hm_mean[m, 2] = heading, 0.0, 0.0
        for i in range(3):
            for j in range(3):
                row.hm_cov[m, i, j] = 0.0
        row.hm_cov[m, 0, 0] = white + slow * slow
        row.hm_cov[m, 1, 1] = t.gyro_std**2
        row.hm_cov[m, 2, 2] = slow * slow
        row.hm_cov[m, 0, 2] = row.hm_cov[m, 2, 0] = -slow * slow
        row.hm_loglik[m] = 0.0 if m == 0 else -2.0
    row.hm_started = 1
    row.model = 0


@njit(nogil=True)
def predict_models(row: Any, node: Any, variance: float, t: Tuning) -> None:
    """yaw += dyaw - b dt; the slow error decays. At rest the increment measures the gyro bias."""
    dt = node.dt_s
    for m in range(MODELS):
        _, slow, tau = model_of(m, variance)
        s, P = row.hm_mean[m], row.hm_cov[m]
        if node.rest == 1 and dt > 0.0:
            _scalar(s, P, 1, node.dyaw / dt - s[1], node.dyaw_var / dt**2 + t.rest_rate_std**2)
        decay = math.exp(-dt / tau)
        s[0] += node.dyaw - s[1] * dt
        s[2] *= decay
        P[0, 0] += dt * dt * P[1, 1] - 2.0 * dt * P[0, 1] + node.dyaw_var
        P[0, 1] -= dt * P[1, 1]
        P[0, 2] = (P[0, 2] - dt * P[1, 2]) * decay
        P[1, 2] *= decay
        P[2, 2] = P[2, 2] * decay * decay + slow * slow * (1.0 - decay * decay)
        P[1, 1] += t.q_gyro * dt
        P[1, 0], P[2, 0], P[2, 1] = P[0, 1], P[0, 2], P[1, 2]


@njit(nogil=True)
def _scalar(s: Any, P: Any, k: int, e: float, variance: float) -> None:
    S = P[k, k] + variance
    k0, k1, k2 = P[0, k] / S, P[1, k] / S, P[2, k] / S
    _gain(s, P, k0, k1, k2, e, S)


@njit(nogil=True)
def _gain(s: Any, P: Any, k0: float, k1: float, k2: float, e: float, S: float) -> None:
    s[0] += k0 * e
    s[1] += k1 * e
    s[2] += k2 * e
    P[0, 0] -= k0 * k0 * S
    P[0, 1] -= k0 * k1 * S
    P[0, 2] -= k0 * k2 * S
    P[1, 1] -= k1 * k1 * S
    P[1, 2] -= k1 * k2 * S
    P[2, 2] -= k2 * k2 * S
    P[1, 0], P[2, 0], P[2, 1] = P[0, 1], P[0, 2], P[1, 2]


@njit(nogil=True)
def judge_models(row: Any, node: Any, t: Tuning) -> int:
    """Update every model with the heading; returns the model to use (3 nats of hysteresis)."""
    forget = math.exp(-node.dt_s / t.model_forget)
    best = 0
    for m in range(MODELS):
        white, _, _ = model_of(m, node.heading_var)
        s, P = row.hm_mean[m], row.hm_cov[m]
        e = wrap(node.heading - s[0] - s[2])
        p0, p1, p2 = P[0, 0] + P[0, 2], P[1, 0] + P[1, 2], P[2, 0] + P[2, 2]
        S = p0 + p2 + white
        row.hm_loglik[m] = row.hm_loglik[m] * forget - 0.5 * min(e * e / S, 25.0) - 0.5 * math.log(S)
        _gain(s, P, p0 / S, p1 / S, p2 / S, e, S)
        if row.hm_loglik[m] > row.hm_loglik[best]:
            best = m
    if row.hm_loglik[best] > row.hm_loglik[row.model] + 3.0:
        return best
    return int(row.model)
