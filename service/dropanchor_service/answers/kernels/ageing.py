"""Derive from poses what an answer adds: the state at their age, and the ellipse."""

import math
from typing import Any, Final

from numba import njit

from dropanchor_service.estimation.columns import State, StateReason

STALE_AFTER_S: Final = 1.0
LOST_AFTER_S: Final = 10.0
CHI2_95_OF_2: Final = (
    5.991464547107979  # -2 ln 0.05: 95 % quantile of the chi-squared distribution, 2 degrees of freedom
)

_TRACKING: Final = int(State.TRACKING)
_COASTING: Final = int(State.COASTING)
_LOST: Final = int(State.LOST)
_RANGES_MISSING: Final = int(StateReason.RANGES_MISSING)


@njit(cache=True, nogil=True)
def age_poses(poses: Any, age_s: Any) -> None:
    """Set the state and reason that POSE rows have at this age, in place. What never had a place cannot lose it."""
    for i in range(len(poses)):
        if not math.isfinite(poses[i].x):
            continue
        lost = age_s[i] > LOST_AFTER_S
        if lost or (age_s[i] > STALE_AFTER_S and poses[i].state == _TRACKING):
            poses[i].state = _LOST if lost else _COASTING
            poses[i].reason = _RANGES_MISSING


@njit(cache=True, nogil=True)
def ellipses(cov: Any, axes: Any) -> None:
    """Fill `axes` (3 × n) with semi-major axis [m], semi-minor axis [m] and direction [rad] of 95 % ellipses.

    cov: n × 2 × 2 or more, of which the first two rows and columns are those of (x, y); an ellipse that is not finite
    becomes NaN. The axes are sqrt(χ² λ), with the eigenvalues λ of a symmetric 2 × 2 matrix in closed form.
    """
    for i in range(len(cov)):
        a, b, c = cov[i, 0, 0], cov[i, 0, 1], cov[i, 1, 1]
        mean, half = (a + c) / 2, math.hypot((a - c) / 2, b)
        major, minor = math.sqrt(CHI2_95_OF_2 * max(mean + half, 0.0)), math.sqrt(CHI2_95_OF_2 * max(mean - half, 0.0))
        angle = math.atan2(2 * b, a - c) / 2
        known = math.isfinite(a) and math.isfinite(b) and math.isfinite(c) and math.isfinite(major)
        axes[0, i], axes[1, i], axes[2, i] = (major, minor, angle) if known else (math.nan, math.nan, math.nan)
