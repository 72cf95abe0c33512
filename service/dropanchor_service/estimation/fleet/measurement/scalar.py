"""What all measurements share: the update of a hypothesis with one scalar."""

import math

from dropanchor_service.estimation.fleet.angles import TWO_PI
from dropanchor_service.estimation.fleet.belief.layout import Belief, Floats, N
from dropanchor_service.estimation.fleet.compiled import njit


@njit(nogil=True)
def gaussian(e: float, S: float) -> float:
    """Return the density of N(0, S) at e."""
    return math.exp(-0.5 * e * e / S) / math.sqrt(TWO_PI * S)


@njit(nogil=True)
def project(P: Floats, H: Floats, PH: Floats) -> float:
    """Fill PH with P H and return H^T P H."""
    total = 0.0
    for i in range(N):
        PH[i] = 0.0
    for k in range(N):
        h = H[k]
        if h != 0.0:
            for i in range(N):
                PH[i] += P[i, k] * h
    for k in range(N):
        total += H[k] * PH[k]
    return float(total)


@njit(nogil=True, inline="never")
def update_pda(s: Floats, P: Floats, PH: Floats, S: float, e: float, beta: float) -> None:
    """Update with one scalar of innovation e that is no outlier with probability beta (PDA, Bar-Shalom).

    s += beta K e,  P -= K K^T (beta S - beta (1 - beta) e^2),  K = P H / S
    """
    shrink = (beta * S - beta * (1.0 - beta) * e * e) / (S * S)
    for i in range(N):
        s[i] += PH[i] * (beta * e / S)
        a = PH[i] * shrink
        for j in range(N):
            P[i, j] -= a * PH[j]


@njit(nogil=True)
def update_component(s: Floats, P: Floats, PH: Floats, index: int, z: float, variance: float) -> None:
    """Update with z, a measurement of one component of the state."""
    for i in range(N):
        PH[i] = P[i, index]
    S = P[index, index] + variance
    update_pda(s, P, PH, S, z - s[index], 1.0)


@njit(nogil=True)
def record_innovation(belief: Belief, y: float, S: float, p_outlier: float) -> None:
    belief.innovation = y
    belief.innovation_variance = S
    belief.p_outlier = p_outlier
