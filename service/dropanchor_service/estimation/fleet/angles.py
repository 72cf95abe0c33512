"""The one function that brings angles back to a half turn either side of zero, for compiled code."""

import math

from dropanchor_service.estimation.fleet.compiled import njit

TWO_PI = 2.0 * math.pi


@njit(cache=True, nogil=True)
def wrap(angle: float) -> float:
    """Return the angle in [-pi, pi), rad. numba has no `math.remainder`."""
    return float(angle - TWO_PI * math.floor(angle / TWO_PI + 0.5))
