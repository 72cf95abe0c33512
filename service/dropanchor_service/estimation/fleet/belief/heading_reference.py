"""What an error of the heading's reference means for the covariance of a hypothesis."""

from typing import Any

from dropanchor_service.estimation.fleet.belief.layout import MOUNT, PHI, REF, YAW, N
from dropanchor_service.estimation.fleet.compiled import njit


@njit(nogil=True)
def give_reference_error(P: Any, std: float, yaw_follows: bool) -> None:
    """Let the heading reference be wrong by `std`; the yaw known only from it shares that error."""
    P[REF, REF] += std * std
    if yaw_follows:
        P[YAW, YAW] += std * std
        P[YAW, REF] -= std * std
        P[REF, YAW] = P[YAW, REF]


@njit(nogil=True)
def turn_about(P: Any, std: float) -> None:
    """An error of the reference that turned bearing and yaw together about the anchor."""
    v = std * std
    P[YAW, YAW] += v
    P[PHI, PHI] += v
    P[REF, REF] += v
    P[YAW, PHI] += v
    P[YAW, REF] -= v
    P[PHI, REF] -= v
    P[PHI, YAW], P[REF, YAW], P[REF, PHI] = P[YAW, PHI], P[YAW, REF], P[PHI, REF]


@njit(nogil=True)
def recount_yaw(P: Any, variance: float) -> None:
    """Count yaw from a reference that agrees with it now: its error is the reference's, what it was is the mount's.

    mount' = mount + yaw - yaw', so the course is what it was.
    """
    for i in range(N):
        P[MOUNT, i] += P[YAW, i]
    for i in range(N):
        P[i, MOUNT] += P[i, YAW]
    for i in range(N):
        P[YAW, i] = P[i, YAW] = P[REF, i] = P[i, REF] = 0.0
    P[YAW, YAW] = P[REF, REF] = variance
    P[YAW, REF] = P[REF, YAW] = -variance
    for i in range(N):
        P[MOUNT, i] -= P[YAW, i]
    for i in range(N):
        P[i, MOUNT] -= P[i, YAW]
