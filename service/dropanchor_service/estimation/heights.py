"""How likely a height that is not exact lies between two others, and on which of several floors."""

import math

import numpy as np
from numba import njit

from dropanchor_service.estimation.columns import Array


@njit(cache=True, nogil=True)
def p_between(z: float, std: float, low: float, high: float) -> float:
    """Return the probability that a height with this mean and standard deviation, m, lies between two others."""
    if not std > 0.0:
        return 1.0 if low <= z < high else 0.0
    scale = std * math.sqrt(2.0)
    return 0.5 * (math.erf((high - z) / scale) - math.erf((low - z) / scale))


@njit(cache=True, nogil=True)
def find_floors(
    z: Array, std: Array, bottom: Array, top: Array, number: Array, of_floor: Array, found: Array, probability: Array
) -> None:
    """Fill the number and the probability of the likeliest floor of each height, unless it is likelier on none.

    z, std: n, m, NaN: not known. bottom, top, number: of each range of heights, and the floor that it belongs to.
    of_floor: room for the probability of each floor.
    """
    for i in range(len(z)):
        if not math.isfinite(z[i]):
            continue
        of_floor[:] = 0.0
        for k in range(len(bottom)):
            of_floor[number[k]] += p_between(z[i], std[i], bottom[k], top[k])
        best = np.argmax(of_floor)
        if of_floor[best] > 1.0 - of_floor.sum():
            found[i], probability[i] = best, min(of_floor[best], 1.0)
