"""The bounds on the speed: no measurement, but what an operator says or nobody exceeds."""

import math
from typing import Final

from dropanchor_service.estimation.fleet.angles import TWO_PI
from dropanchor_service.estimation.fleet.belief.layout import Floats, Hypothesis, N, Row, V
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning

ASYMPTOTIC: Final = -8.0  # standard deviations beyond which erfc has no digits left
HALF_LOG_TWO_PI: Final = 0.9189385332  # log sqrt(2 pi)


@njit(nogil=True, borrows=True)
def bound_speed(one: Hypothesis, row: Row, node: Node, t: Tuning, PH: Floats) -> float:
    """Truncate the speed of a hypothesis to what its direction and its carrier allow. Return the change of its weight.

    Without an accelerometer a tag that may reverse has one hypothesis for both directions.
    """
    fastest = row.settings.speed_max if node.carried == 0 else min(row.settings.speed_max, t.walk_speed_max)
    either = row.settings.reverse_allowed == 1 and not math.isfinite(node.dv_var)
    low = -row.settings.speed_max if either or one.reverse == 1 else -t.reverse_slack
    high = fastest if either or one.reverse == 0 else t.reverse_slack
    return truncate_speed(one.mean, one.cov, PH, low, high)


@njit(nogil=True)
def truncate_speed(s: Floats, P: Floats, PH: Floats, low: float, high: float) -> float:
    """Truncate the speed to [low, high] if its mean is outside. Return the log of the probability that was kept.

    The moments are those of a one-sided truncated Gaussian; the other states follow by their covariance with the speed.
    """
    if low <= s[V] <= high:
        return 0.0
    sd = math.sqrt(max(P[V, V], 1e-12))
    a, sign = ((s[V] - low) / sd, 1.0) if s[V] < low else ((high - s[V]) / sd, -1.0)
    if a < ASYMPTOTIC:  # Mills ratio
        ratio = -a + 1.0 / -a
        log_mass = -0.5 * a * a - math.log(-a) - HALF_LOG_TWO_PI
    else:
        mass = 0.5 * math.erfc(-a / math.sqrt(2.0))
        ratio = math.exp(-0.5 * a * a) / math.sqrt(TWO_PI) / mass
        log_mass = math.log(mass)
    kept = max(1.0 - ratio * (ratio + a), 1e-3)
    gain = sign * ratio * sd / P[V, V]
    for i in range(N):
        PH[i] = P[i, V]
    shrink = (1.0 - kept) / P[V, V]
    for i in range(N):
        s[i] += PH[i] * gain
        for j in range(N):
            P[i, j] -= PH[i] * PH[j] * shrink
    return float(log_mass)
