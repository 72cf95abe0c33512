"""Compute the probability that a Gaussian position lies inside a polygon.

In coordinates in which the covariance is the identity and the mean the origin, the divergence theorem turns the
integral of the density over the polygon into a sum over its edges. An edge at the signed distance h from the origin,
whose points have the coordinate s along it, contributes

    1 / 2π ∫ h / (h² + s²) · (1 − exp(−(h² + s²) / 2)) ds.

The integrand is smooth for every h, also where the edge passes through the mean. Gauss-Legendre quadrature covers
|s| < 5; beyond that the exponential vanishes and the integral is an angle.
"""

import math
from typing import Any, Final

import numpy as np
from numba import njit

NODES, WEIGHTS = (tuple(column.tolist()) for column in np.polynomial.legendre.leggauss(10))
REACH: Final = 5.0  # standard deviations beyond which the density counts as zero
SMALL: Final = 1e-6  # below it, (1 - exp(-q / 2)) / q is 0.5
MIN_STD_M: Final = 1e-3  # of a position: no estimate is better, and a smaller one would divide by zero
_TWO_PI: Final = 2.0 * math.pi


@njit(cache=True, nogil=True)
def p_inside(mean_x: float, mean_y: float, cov: Any, vertices: Any, first: int, end: int) -> float:
    """Return the probability that the position lies inside the polygon vertices[first:end], counter-clockwise.

    cov: of which [0, 0], [0, 1] and [1, 1] are the variances and the covariance of x and y, m².
    """
    a = math.sqrt(max(cov[0, 0], MIN_STD_M**2))
    b = cov[0, 1] / a
    c = math.sqrt(max(cov[1, 1] - b * b, MIN_STD_M**2))
    total = 0.0
    u = (vertices[end - 1, 0] - mean_x) / a
    v = (vertices[end - 1, 1] - mean_y - b * u) / c
    for i in range(first, end):
        next_u = (vertices[i, 0] - mean_x) / a
        next_v = (vertices[i, 1] - mean_y - b * next_u) / c
        total += _edge(u, v, next_u, next_v)
        u, v = next_u, next_v
    return min(max(total, 0.0), 1.0)


@njit(cache=True, nogil=True)
def _edge(u: float, v: float, to_u: float, to_v: float) -> float:
    """Return the contribution of the edge from (u, v) to (to_u, to_v), in whitened coordinates."""
    length = math.hypot(to_u - u, to_v - v)
    if length == 0.0:
        return 0.0
    along_u, along_v = (to_u - u) / length, (to_v - v) / length
    h = u * along_v - v * along_u
    if h == 0.0:
        return 0.0
    start = u * along_u + v * along_v
    end = start + length
    if abs(h) >= REACH or start >= REACH or end <= -REACH:
        return (math.atan(end / h) - math.atan(start / h)) / _TWO_PI
    low, high = max(start, -REACH), min(end, REACH)
    angle = math.atan(end / h) - math.atan(high / h) + math.atan(low / h) - math.atan(start / h)
    half, middle = (high - low) / 2.0, (high + low) / 2.0
    integral = 0.0
    for k in range(len(NODES)):
        q = h * h + (middle + half * NODES[k]) ** 2
        integral += WEIGHTS[k] * ((1.0 - math.exp(-q / 2.0)) / q if q > SMALL else 0.5)
    return (angle + h * half * integral) / _TWO_PI
