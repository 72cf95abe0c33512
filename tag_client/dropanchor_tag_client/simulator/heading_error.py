"""Errors of a heading reference that do not average out: constant, drifting, correlated."""

import math
from dataclasses import dataclass

import numpy as np

from dropanchor_tag_client.simulator.noise import gauss_markov
from dropanchor_tag_client.simulator.trajectory import Array, Trajectory


@dataclass(frozen=True)
class HeadingErrorModel:
    """bias + drift · sin(2π t / drift_period) + Gauss-Markov(correlated_std, correlation_s). rad, s.

    For scalar sensors this is the error of the heading. For raw sensors it is the azimuth error of the magnetic field.
    """

    bias: float = 0.0
    drift: float = 0.0
    drift_period_s: float = 40.0
    correlated_std: float = 0.0
    correlation_s: float = 3.0

    def draw(self, motion: Trajectory, rng: np.random.Generator) -> Array:
        """Return the heading error over a motion, (n,) rad."""
        error = self.bias + self.drift * np.sin(math.tau * motion.t / self.drift_period_s)
        first = self.correlated_std * rng.standard_normal()
        return error + gauss_markov(rng, len(motion), motion.dt, self.correlated_std, self.correlation_s, first)
