"""How well the ranges of the last seconds alone fix the position."""

import math

from dropanchor_service.estimation.fleet.belief.layout import Floats
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def predict_information(J: Floats, course: float, dt: float, q: float, t: Tuning) -> None:
    """Predict the information J on (x, y, speed) over dt for p += v u dt.

    J <- e^(-dt/W) A^-T J A^-1, then the speed loses some of it: J -= J e_v e_v^T J q / (1 + q J_vv).
    """
    c, s = math.cos(course) * dt, math.sin(course) * dt
    for j in range(3):
        J[2, j] -= c * J[0, j] + s * J[1, j]
    for i in range(3):
        J[i, 2] -= c * J[i, 0] + s * J[i, 1]
    keep = math.exp(-dt / t.obs_window)
    loss = q * dt / (1.0 + q * dt * keep * J[2, 2])
    v0, v1, v2 = J[0, 2] * keep, J[1, 2] * keep, J[2, 2] * keep
    for i in range(3):
        for j in range(3):
            J[i, j] *= keep
    J[0, 0] -= v0 * v0 * loss
    J[0, 1] -= v0 * v1 * loss
    J[0, 2] -= v0 * v2 * loss
    J[1, 1] -= v1 * v1 * loss
    J[1, 2] -= v1 * v2 * loss
    J[2, 2] -= v2 * v2 * loss
    J[1, 0], J[2, 0], J[2, 1] = J[0, 1], J[0, 2], J[1, 2]


@njit(nogil=True)
def sigma_obs(J: Floats) -> float:
    """Return sqrt(lambda_max(J^-1)_xy), m: infinite where the ranges of the window do not fix a position."""
    if J[2, 2] <= 0.0:
        return math.inf
    a = J[0, 0] - J[0, 2] ** 2 / J[2, 2]  # Schur complement: information on (x, y) alone
    b = J[0, 1] - J[0, 2] * J[1, 2] / J[2, 2]
    d = J[1, 1] - J[1, 2] ** 2 / J[2, 2]
    smallest = 0.5 * (a + d) - math.sqrt(0.25 * (a - d) ** 2 + b * b)
    if smallest < 1e-6:
        return math.inf
    return 1.0 / math.sqrt(smallest)
