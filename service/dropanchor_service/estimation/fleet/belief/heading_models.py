"""How wrong the heading reference is: two models of its error, chosen by their predictions.

Each model m is a Kalman filter over (yaw, gyroscope bias, slow error) with the node's yaw increment and heading. The
first takes the claimed variance to be white, the second the error to wander for seconds, which does not average out.
The bias may change quickly here: where a gyroscope drifts, the heading is not to blame.

    predict   yaw += dyaw - b dt,   slow *= exp(-dt/tau)          update   heading = yaw + slow + white
"""

import math

from dropanchor_service.estimation.columns import HeadingSource
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.layout import (
    MAGNETOMETER_MODEL,
    MODELS,
    OWN_ERROR,
    PLATFORM_MODEL,
    Floats,
    Row,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import RESTING, Node
from dropanchor_service.estimation.fleet.frontend.standstill import BIAS_SD
from dropanchor_service.estimation.fleet.tuning import Tuning

REFERENCE_STD = 0.1  # rad, constant error of a heading reference, beside that of the declination
SOFT_IRON_FACTOR = 3.0  # times the claimed error of a magnetometer
SWITCH_LOG_RATIO = 10.0  # log likelihood by which another model must win
BIAS_WALK = 1e-5  # (rad/s)^2/s, of the gyroscope's bias in these models
MAX_SQUARED_ERROR = 25.0  # in variances: one reading must not decide between models
SLOW_TAU = 60.0  # s, of an error of the reference that is given, of a platform's, or of a class of its own
FROM_IMU = int(HeadingSource.IMU)


@njit(nogil=True)
def model_parameters(m: int, variance: float) -> tuple[float, float, float]:
    """Return (white variance rad^2, sd of the slow error rad, its time constant s) of model m."""
    if m == MAGNETOMETER_MODEL:
        return 0.01 * variance + 1e-5, math.sqrt(variance), 30.0
    if m == PLATFORM_MODEL:
        return 4e-4, 0.03, SLOW_TAU
    if m == 1:
        return 0.01 * variance, 0.1, 3.0
    return variance, 0.0, 20.0


@njit(nogil=True)
def reference_error(row: Row, variance: float) -> tuple[float, float, float]:
    """Return `model_parameters` of the row's model, or what the operator gave for the heading.

    For a magnetometer that is beside what its filter claims. Without it, and with a given start heading, a magnetometer
    gets three times the error it claims. Soft iron and the place disturb it in the same way on every lap, so that does
    not average out; gyroscope and ranges know the yaw better for minutes.
    """
    if row.heading.model == MAGNETOMETER_MODEL:
        white, slow, tau = model_parameters(MAGNETOMETER_MODEL, variance)
        if is_north_given(row):
            slow = math.hypot(slow, row.settings.heading_std)
        elif row.start.known == 1 and math.isfinite(row.start.heading):
            slow *= SOFT_IRON_FACTOR
        return white, slow, tau
    if not is_heading_std_given(row):
        return model_parameters(row.heading.model, variance)
    white, _, _ = model_parameters(PLATFORM_MODEL if row.heading.model == PLATFORM_MODEL else 0, variance)
    return white, row.settings.heading_std, SLOW_TAU


@njit(nogil=True)
def class_reference_error(row: Row, heading_class: int, variance: float, t: Tuning) -> tuple[float, float, float]:
    """Return `reference_error` of one class of hypotheses."""
    white, slow, tau = reference_error(row, variance)
    if heading_class == OWN_ERROR and row.heading.model != PLATFORM_MODEL:
        return white, math.sqrt(slow * slow + t.own_error_std**2), SLOW_TAU
    return white, slow, tau


@njit(nogil=True)
def is_heading_std_given(row: Row) -> bool:
    """Return whether the operator gave the error of the heading in use."""
    if row.heading.model == MAGNETOMETER_MODEL:
        return is_north_given(row)
    return math.isfinite(row.settings.heading_std)


@njit(cache=True, nogil=True)
def reference_std(row: Row) -> float:
    """Return the standard deviation of the constant error of the heading reference in use, rad.

    That of a magnetometer has the error of the site's declination in it.
    """
    if is_heading_std_given(row):
        return float(row.settings.heading_std)
    return float(row.settings.reference_std) if row.heading.model == MAGNETOMETER_MODEL else REFERENCE_STD


@njit(nogil=True)
def is_north_given(row: Row) -> bool:
    """Return whether the operator gave the error of north. With the IMU as the source it is that of no platform."""
    return bool(row.settings.heading_source == FROM_IMU and math.isfinite(row.settings.heading_std))


@njit(nogil=True)
def reset_models(row: Row, heading: float, variance: float) -> None:
    """Start both models at this heading, rad."""
    for m in range(MODELS):
        white, slow, _ = model_parameters(m, variance)
        s, P = row.heading.model_mean[m], row.heading.model_cov[m]
        s[:] = heading, 0.0, 0.0
        P[:] = 0.0
        P[0, 0], P[1, 1], P[2, 2] = white + slow * slow, BIAS_SD**2, slow * slow
        P[0, 2] = P[2, 0] = -slow * slow
        row.heading.model_log_likelihood[m] = 0.0
    row.heading.models_started = 1
    row.heading.model = 0


@njit(nogil=True)
def predict_models(row: Row, node: Node, variance: float, t: Tuning) -> None:
    """Predict both models over the node. At rest the increment measures the gyroscope's bias."""
    dt = node.dt_s
    for m in range(MODELS):
        _, slow, tau = model_parameters(m, variance)
        s, P = row.heading.model_mean[m], row.heading.model_cov[m]
        if node.rest == RESTING and dt > 0.0:
            S = P[1, 1] + node.dyaw_var / dt**2 + t.rest_gyro_std**2
            _apply_gain(s, P, P[0, 1] / S, P[1, 1] / S, P[2, 1] / S, node.dyaw / dt - s[1], S)
        decay = math.exp(-dt / tau)
        s[0] += node.dyaw - s[1] * dt
        s[2] *= decay
        P[0, 0] += dt * dt * P[1, 1] - 2.0 * dt * P[0, 1] + node.dyaw_var
        P[0, 1] -= dt * P[1, 1]
        P[0, 2] = (P[0, 2] - dt * P[1, 2]) * decay
        P[1, 2] *= decay
        P[2, 2] = P[2, 2] * decay * decay + slow * slow * (1.0 - decay * decay)
        P[1, 1] += BIAS_WALK * dt
        P[1, 0], P[2, 0], P[2, 1] = P[0, 1], P[0, 2], P[1, 2]


@njit(nogil=True)
def _apply_gain(s: Floats, P: Floats, k0: float, k1: float, k2: float, e: float, S: float) -> None:
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
def update_models(row: Row, node: Node, t: Tuning) -> int:
    """Update both models with the node's heading. Return the model to use, with hysteresis."""
    forget = math.exp(-node.dt_s / t.model_forget)
    log_likelihood = row.heading.model_log_likelihood
    best = 0
    for m in range(MODELS):
        white, _, _ = model_parameters(m, node.heading_var)
        s, P = row.heading.model_mean[m], row.heading.model_cov[m]
        e = wrap(node.heading - s[0] - s[2])
        p0, p1, p2 = P[0, 0] + P[0, 2], P[1, 0] + P[1, 2], P[2, 0] + P[2, 2]
        S = p0 + p2 + white
        gained = -0.5 * min(e * e / S, MAX_SQUARED_ERROR) - 0.5 * math.log(S)
        log_likelihood[m] = log_likelihood[m] * forget + gained
        _apply_gain(s, P, p0 / S, p1 / S, p2 / S, e, S)
        if log_likelihood[m] > log_likelihood[best]:
            best = m
    if log_likelihood[best] > log_likelihood[row.heading.model] + SWITCH_LOG_RATIO:
        return best
    return int(row.heading.model)
