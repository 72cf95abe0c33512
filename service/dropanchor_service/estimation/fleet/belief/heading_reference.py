"""How an error of the heading reference enters the covariance of a hypothesis."""

import math

from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.belief.births.forgetting import REFERENCE_ERROR, forget
from dropanchor_service.estimation.fleet.belief.layout import (
    EXACT,
    MOUNT,
    PHI,
    REFERENCE,
    YAW,
    Floats,
    Hypothesis,
    N,
    Row,
)
from dropanchor_service.estimation.fleet.belief.mixture import clear_state
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import MEASURED_HEADING, Node


@njit(nogil=True)
def add_reference_error(P: Floats, std: float, yaw_from_reference: bool) -> None:
    """Add an error of the reference, sd in rad. A yaw that is known only from the reference shares that error."""
    P[REFERENCE, REFERENCE] += std * std
    if yaw_from_reference:
        P[YAW, YAW] += std * std
        P[YAW, REFERENCE] -= std * std
        P[REFERENCE, YAW] = P[YAW, REFERENCE]


@njit(nogil=True)
def follow_reference(decay: float, before: float, after: float) -> tuple[float, float]:
    """Return decay and growth of the error of a reference whose variance goes from `before` to `after`, rad^2.

    decay: that of an error that does not learn. A Kalman filter of a constant has cov(error after, error before) =
    variance after: what the reference learns shrinks the error that the hypotheses share with it.
    """
    if after < before:
        decay *= after / before
        return decay, after - decay * decay * before
    return decay, after * (1.0 - decay * decay) + after - before


@njit(nogil=True)
def add_common_rotation(P: Floats, std: float) -> None:
    """Add an error of the reference, sd in rad, that turned bearing and yaw together about the anchor."""
    v = std * std
    P[YAW, YAW] += v
    P[PHI, PHI] += v
    P[REFERENCE, REFERENCE] += v
    P[YAW, PHI] += v
    P[YAW, REFERENCE] -= v
    P[PHI, REFERENCE] -= v
    P[PHI, YAW], P[REFERENCE, YAW], P[REFERENCE, PHI] = P[YAW, PHI], P[YAW, REFERENCE], P[PHI, REFERENCE]


@njit(nogil=True)
def turn_to_yaw(P: Floats) -> None:
    """Turn bearing and yaw together so that the yaw is exact: the error that it had becomes one of the bearing."""
    for i in range(N):
        P[PHI, i] -= P[YAW, i]
    for i in range(N):
        P[i, PHI] -= P[i, YAW]
    clear_state(P, YAW, 0.0)


@njit(nogil=True)
def adopt_reference(P: Floats, variance: float) -> None:
    """Let yaw count from a reference that agrees with it now.

    The error of the new yaw is that of the reference, rad^2; the error of the old one becomes the mounting angle's:
    mount' = mount + yaw - yaw', which leaves the course as it was.
    """
    for i in range(N):
        P[MOUNT, i] += P[YAW, i]
    for i in range(N):
        P[i, MOUNT] += P[i, YAW]
    clear_state(P, YAW, variance)
    clear_state(P, REFERENCE, variance)
    P[YAW, REFERENCE] = P[REFERENCE, YAW] = -variance
    for i in range(N):
        P[MOUNT, i] -= P[YAW, i]
    for i in range(N):
        P[i, MOUNT] -= P[i, YAW]


@njit(nogil=True)
def is_of_another_axis(row: Row, node: Node) -> bool:
    """Return whether the yaw counts from what others call the heading of a carried tag whose body x axis is upright.

    That axis has no azimuth. They mean another one of the device, or where its carrier looks.
    """
    told = node.heading_kind == MEASURED_HEADING or math.isfinite(row.start.heading)
    return bool(node.upright == 1 and told)


@njit(nogil=True)
def restart_reference(one: Hypothesis, row: Row, yaw: float, variance: float) -> None:
    """Take the yaw, rad, from the reference, and forget what the errors of both seemed to be.

    The yaw of a vehicle is the azimuth of a body axis. Where that axis is upright, it turns by anything, and the
    reference and the gyroscope were blamed for it.
    """
    s, P = one.mean, one.cov
    one.heading_class = EXACT
    s[YAW], s[REFERENCE] = wrap(yaw), 0.0
    clear_state(P, YAW, variance)
    clear_state(P, REFERENCE, 0.0)
    forget(row, REFERENCE_ERROR)
