"""Scalar sensors of a level body: heading, yaw rate and forward acceleration."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dropanchor_tag_client.simulator.noise import gauss_markov
from dropanchor_tag_client.simulator.trajectory import Array, Trajectory

AT_REST_MPS = 1e-6


class Scalars(NamedTuple):
    """Scalar samples as columns (n,). Yaw rate and acceleration are means over the time since the previous row."""

    t_s: Array
    heading_rad: Array
    gyro_radps: Array
    acceleration_mps2: Array


@dataclass(frozen=True)
class ScalarModel:
    """White noise of each sample, and biases N(0, …_bias_std) that are constant over a run. rad, m, s.

    gyro_drift: amplitude of a `slow_drift` of the gyro. leak_std, leak_tau_s: Gauss-Markov error of the forward
    acceleration, from gravity through a tilt error. acceleration_std_rest: noise while the tag is at rest.
    """

    heading_std: float = 0.1
    gyro_std: float = 0.02
    gyro_bias_std: float = 0.01
    gyro_drift: float = 0.0
    acceleration_std: float = 0.1
    acceleration_std_rest: float = 0.02
    acceleration_bias_std: float = 0.1
    leak_std: float = 0.05
    leak_tau_s: float = 5.0

    def measure(self, motion: Trajectory, mount: float, heading_error: Array, rng: np.random.Generator) -> Scalars:
        """Return the samples of a motion.

        mount: course minus body yaw, rad. heading_error: (n,) rad, error of the reference in addition to white noise.
        """
        n, dt = len(motion), motion.dt
        heading = motion.course - mount + heading_error + self.heading_std * rng.standard_normal(n)
        gyro = backward_rate(motion.course, dt) + self.gyro_std * rng.standard_normal(n)
        gyro += self.gyro_bias_std * rng.standard_normal() + self.gyro_drift * slow_drift(motion.t)
        return Scalars(motion.t, wrapped(heading), gyro, self._acceleration(motion, rng))

    def _acceleration(self, motion: Trajectory, rng: np.random.Generator) -> Array:
        n, dt = len(motion), motion.dt
        rest = (np.abs(motion.v) < AT_REST_MPS) & (np.abs(motion.w) < AT_REST_MPS)
        white = np.where(rest, self.acceleration_std_rest, self.acceleration_std) * rng.standard_normal(n)
        bias = self.acceleration_bias_std * rng.standard_normal()
        first = self.leak_std * rng.standard_normal()
        leak = gauss_markov(rng, n, dt, self.leak_std, self.leak_tau_s, first)
        return backward_rate(motion.v, dt) + white + bias + leak


def backward_rate(column: Array, dt: float) -> Array:
    """Return the mean rate since the previous row, as an inertial sensor integrates it; 0 in the first row."""
    return np.diff(column, prepend=column[0]) / dt


def slow_drift(t: Array) -> Array:
    """Return a sine with a period of 60 s: a gyro bias that changes with temperature."""
    return np.sin(2 * np.pi * t / 60.0)


def wrapped(angle: Array) -> Array:
    """Return the angle within [-π, π)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
