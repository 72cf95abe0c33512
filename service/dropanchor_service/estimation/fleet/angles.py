"""The one function that brings angles back to a half turn either side of zero, for compiled code."""

import math

from dropanchor_service.estimation.fleet.compiled import njit

TWO_PI = 2.0 * math.pi
INSIDE = 3.0  # rad, of angles that are within the half turn without doubt


@njit(cache=True, nogil=True)
def wrap(angle: float) -> float:
    """Return the angle in [-pi, pi), rad. numba has no `math.remainder`. Most angles need no division."""
    if -INSIDE < angle < INSIDE:
        return angle
    return float(angle - TWO_PI * math.floor(angle / TWO_PI + 0.5))
