"""A standstill: the speed is zero, and the gyroscope reads its bias."""

import math

from dropanchor_service.estimation.fleet.belief.layout import GYRO_BIAS, Floats, Hypothesis, V
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import RESTING, Node
from dropanchor_service.estimation.fleet.measurement.scalar import update_component
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def standing_log_likelihood(one: Hypothesis, t: Tuning) -> float:
    """Return the log likelihood of a speed of zero."""
    S = one.cov[V, V] + t.rest_std**2
    return float(-0.5 * one.mean[V] ** 2 / S - 0.5 * math.log(S))


@njit(nogil=True, borrows=True)
def update_standstill(s: Floats, P: Floats, PH: Floats, node: Node, t: Tuning) -> float:
    """Update with standstill: the speed is zero, and the gyroscope reads its bias. Return the latter's log likelihood.

    An IMU's front-end has already removed the bias; then only the variance of what is left is learned.
    """
    if node.rest == RESTING:
        update_component(s, P, PH, V, 0.0, t.rest_std**2)
    if node.carried == 1:
        return 0.0
    if node.gyro_bias_var > 0.0:
        if P[GYRO_BIAS, GYRO_BIAS] > 1.001 * node.gyro_bias_var:
            update_component(s, P, PH, GYRO_BIAS, 0.0, pseudo_measurement_variance(P[GYRO_BIAS, GYRO_BIAS], node))
        return 0.0
    if node.dt_s <= 0.0:
        return 0.0
    rate = node.dyaw / node.dt_s
    variance = node.dyaw_var / node.dt_s**2 + t.rest_gyro_std**2
    S = P[GYRO_BIAS, GYRO_BIAS] + variance
    e = rate - s[GYRO_BIAS]
    update_component(s, P, PH, GYRO_BIAS, rate, variance)
    return float(-0.5 * e * e / S - 0.5 * math.log(S))


@njit(nogil=True)
def pseudo_measurement_variance(prior: float, node: Node) -> float:
    """Return the variance of a measurement of the gyroscope's bias that turns a larger prior into gyro_bias_var."""
    return float(prior * node.gyro_bias_var / (prior - node.gyro_bias_var))
