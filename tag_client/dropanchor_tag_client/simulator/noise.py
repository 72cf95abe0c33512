"""Reproducible random streams and correlated noise."""

import math
from enum import IntEnum

import numpy as np

from dropanchor_tag_client.simulator.trajectory import Array


class Stream(IntEnum):
    """The use of a random stream. Each use has its own, so changing one sensor does not change the others."""

    MOTION = 0
    RANGE = 1
    SCALAR = 2
    IMU_UNIT = 3
    IMU = 4
    HEADING_ERROR = 5
    GAIT = 6
    NLOS = 7
    AZIMUTH = 8


def stream(seed: int, use: Stream, index: int = 0) -> np.random.Generator:
    """Return the random generator of one seed, one use and one tag (`index`)."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(int(use), index)))


def gauss_markov(rng: np.random.Generator, n: int, dt: float, std: float, tau: float, start: float) -> Array:
    """Return a first-order Gauss-Markov process, (n,).

    x_k = e^(-dt/tau) x_{k-1} + noise, with stationary standard deviation `std` and x_0 = start. A cumulative sum
    solves it in blocks, without a loop over samples. A block spans at most 20 tau, within which the weights
    e^(k dt/tau) keep enough precision.
    """
    decay = math.exp(-dt / tau)
    kicks = std * math.sqrt(1 - decay * decay) * rng.standard_normal(n)
    kicks[0] = start
    block = max(1, int(20 * tau / dt))
    x = np.empty(n)
    carried = 0.0
    for first in range(0, n, block):
        part = kicks[first : first + block]
        fall = decay ** np.arange(1, len(part) + 1)
        x[first : first + block] = fall * (carried + np.cumsum(part / fall))
        carried = x[min(first + block, n) - 1]
    return x
