"""Direction of walking, from the acceleration of the steps.

With every step a walker is pushed forward while the upward acceleration grows. The horizontal acceleration a (level
frame) is therefore correlated with the rate of change of the upward acceleration, and points along the course:

    g = sum a dv/dt,    coherence = |g| / sqrt(sum |a|^2  sum (dv/dt)^2)

All three axes pass the same filter (0.8 to 3 Hz) first. A device in one hand also swings sideways in this rhythm, which
turns g by a constant angle.
"""

import math
from typing import Any, Final, TypeAlias

import numpy as np

from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.gait import TAU_LOW

STRIDE: Final = np.dtype(
    [
        ("slow", "f8", 3),  # m/s^2, slow mean of the acceleration east, north, up in the level frame
        ("low", "f8", (2, 3)),  # m/s^2, two poles of the rest
        ("sums", "f8", 4),  # of a dv/dt (2), |a|^2 and (dv/dt)^2, with forgetting
    ]
)
Stride: TypeAlias = Any  # a record of STRIDE

TAU_HIGH = 0.2  # s: 0.8 Hz
FORGET = 2.0  # s


@njit(cache=True, nogil=True)
def add_stride_sample(d: Stride, dt: float, east: float, north: float, up: float) -> None:
    """Take one acceleration, m/s^2, in the level frame, without gravity."""
    high, k, kept = dt / (TAU_HIGH + dt), dt / (TAU_LOW + dt), 1.0 - dt / FORGET
    for i, value in enumerate((east, north, up)):
        d.slow[i] += high * (value - d.slow[i])
        d.low[0, i] += k * (value - d.slow[i] - d.low[0, i])
        d.low[1, i] += k * (d.low[0, i] - d.low[1, i])
    x, y = d.low[1, 0], d.low[1, 1]
    rate = (d.low[0, 2] - d.low[1, 2]) / TAU_LOW
    d.sums[0] = kept * d.sums[0] + dt * x * rate
    d.sums[1] = kept * d.sums[1] + dt * y * rate
    d.sums[2] = kept * d.sums[2] + dt * (x * x + y * y)
    d.sums[3] = kept * d.sums[3] + dt * rate * rate


@njit(cache=True, nogil=True)
def stride_direction(d: Stride) -> tuple[float, float]:
    """Return (azimuth in the level frame, rad; coherence, 0 to 1)."""
    scale = math.sqrt(d.sums[2] * d.sums[3])
    if scale <= 0.0:
        return 0.0, 0.0
    return math.atan2(d.sums[1], d.sums[0]), math.hypot(d.sums[0], d.sums[1]) / scale
