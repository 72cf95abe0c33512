"""A standstill: the speed is zero, and the gyroscope reads its bias, unless it is a smooth ride."""

import math
from typing import Final

from dropanchor_service.estimation.fleet.angles import TWO_PI
from dropanchor_service.estimation.fleet.belief.layout import GYRO_BIAS, Floats, Hypotheses, Hypothesis, Row, V
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MOVING, RESTING, Node
from dropanchor_service.estimation.fleet.measurement.scalar import update_component
from dropanchor_service.estimation.fleet.tuning import Tuning

SPEEDS: Final = 2.5  # m/s, over which the speed of a moving tag is spread
CERTAIN: Final = 3.0  # standard deviations from zero at which a tag certainly moves
LIKELY: Final = 0.01  # weight from which on a hypothesis may deny that the tag moves
QUIET_TAU: Final = 10.0  # s, over which the share of quiet motion is averaged
QUIET_START, QUIET_MIN = 0.4, 0.005  # that share before any motion: an IMU may filter vibration; and the least of it
SLOW: Final = 0.2  # m/s, of a tag that hardly moves


@njit(nogil=True)
def judge_standstill(work: Hypotheses, count: int, row: Row, node: Node, t: Tuning) -> None:
    """Take the node's rest back if the tag more likely rolls. work: before the node.

    A smooth ride at constant speed looks like rest to accelerometer and gyroscope. So the speeds decide, and how often
    this tag has looked like that while it certainly moved:

        mean of N(0; speed, variance) over the hypotheses  against  P(quiet | moving) / SPEEDS
    """
    quiet = node.rest == RESTING
    if not quiet and row.quiet_share == QUIET_MIN:
        return
    total, at_rest, certain = 0.0, 0.0, True
    for h in range(count):
        weight, speed, variance = math.exp(work[h].log_weight), work[h].mean[V], work[h].cov[V, V] + t.rest_std**2
        total += weight
        at_rest += weight * math.exp(-0.5 * speed * speed / variance) / math.sqrt(TWO_PI * variance)
        if abs(speed) <= max(CERTAIN * math.sqrt(variance), SLOW) and weight > LIKELY:
            certain = False
    if certain:
        share = node.dt_s / (QUIET_TAU + node.dt_s)
        row.quiet_share = max(row.quiet_share + share * (quiet - row.quiet_share), QUIET_MIN)
    if quiet and at_rest < total * row.quiet_share / SPEEDS:
        node.rest = MOVING


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
