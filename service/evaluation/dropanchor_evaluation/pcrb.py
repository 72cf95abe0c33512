"""The posterior Cramér-Rao bound of the position (Tichavský, Muravchik and Nehorai 1998) on the true path of a run.

With additive Gaussian noise, the recursion J' = (Q + F J⁻¹ Fᵀ)⁻¹ + Hᵀ R⁻¹ H is that of a Kalman filter's covariance
with the Jacobians at the truth. The code uses the covariance form, which allows a singular Q.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit

from dropanchor_service.estimation.columns import Array

X, Y, THETA, V, GYRO_BIAS, ACC_BIAS, LEAK = range(7)
AT_REST_MPS = 1e-6


@dataclass(frozen=True)
class Sensors:
    """Standard deviations of single samples (m, rad, rad/s, m/s²) and of errors that are constant over a run.

    start: of x and of y; start_heading and start_speed likewise. leak: gravity in the forward acceleration,
    Gauss-Markov with leak_tau_s. zero_speed: accuracy of a detected standstill, m/s.
    """

    range: float = 0.2
    heading: float = 0.1
    gyro: float = 0.02
    gyro_bias: float = 0.01
    acceleration: float = 0.1
    acceleration_bias: float = 0.1
    leak: float = 0.05
    leak_tau_s: float = 5.0
    zero_speed: float = 0.02
    start: float = 0.1
    start_heading: float = 0.1
    start_speed: float = 0.02


@dataclass(frozen=True)
class Path:
    """The truth at evenly spaced instants, (n,) each; s, m, rad, m/s. ranged: whether the instant has a range."""

    t: Array
    x: Array
    y: Array
    course: Array
    v: Array
    ranged: Array


Information = Literal["range+heading, jumps known", "range+heading, random-walk speed", "with accelerometer"]


def position_bound(path: Path, sensors: Sensors, information: Information) -> Array:
    """Return the bound on E[(x - x̂)² + (y - ŷ)²] after each instant, (n,) m².

    "range+heading, jumps known": the speed may change only while the true speed changes. "range+heading, random-walk
    speed": the same power is spread over the run; this is the bound of a filter with a random-walk speed. "with
    accelerometer": forward acceleration with bias and leak, and detected standstills.
    """
    s = sensors
    accelerometer = information == "with accelerometer"
    acc = (s.acceleration_bias, s.leak) if accelerometer else (0.0, 0.0)
    start = np.array([s.start, s.start, s.start_heading, s.start_speed, s.gyro_bias, *acc]) ** 2
    dt = (path.t[-1] - path.t[0]) / (len(path.t) - 1)
    decay = np.exp(-dt / s.leak_tau_s)
    q_leak = s.leak**2 * (1 - decay**2) if accelerometer else 0.0
    q_speed = (
        np.full(len(path.t), (s.acceleration * dt) ** 2)
        if accelerometer
        else _jump_power(path.v, spread=information == "range+heading, random-walk speed")
    )
    rest = np.abs(path.v) < AT_REST_MPS if accelerometer else np.zeros(len(path.t), bool)
    R = np.array([s.range, s.heading, s.zero_speed]) ** 2
    q = np.array([(s.gyro * dt) ** 2, q_leak])
    path_columns = np.column_stack([path.x, path.y, path.course, path.v])
    bound: Array = _recursion(path_columns, path.ranged, rest, np.diag(start), q, q_speed, R, dt, decay)
    return bound


def _jump_power(v: Array, spread: bool) -> Array:
    """Return the variance of the speed change in each step, (n,): the squared true changes, spread over their ramps."""
    changing = np.diff(v, prepend=v[0]) != 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], changing, [False]]).astype(int)))
    power = np.full(len(v), 1e-10)
    for first, last in edges.reshape(-1, 2):
        power[first:last] += (v[last - 1] - v[max(first - 1, 0)]) ** 2 / (last - first)
    return np.full(len(v), power.mean()) if spread else power


@njit(cache=True)
def _recursion(
    path: Array, ranged: Array, rest: Array, P: Array, q: Array, q_speed: Array, R: Array, dt: float, decay: float
) -> Array:
    bound = np.empty(len(path))
    F = np.eye(7)
    F[THETA, GYRO_BIAS] = -dt
    F[V, ACC_BIAS] = F[V, LEAK] = -dt
    F[LEAK, LEAK] = decay
    for i in range(len(path)):
        if i > 0:
            c, s, v = np.cos(path[i - 1, 2]), np.sin(path[i - 1, 2]), path[i - 1, 3]
            F[X, THETA], F[X, V] = -v * s * dt, c * dt
            F[Y, THETA], F[Y, V] = v * c * dt, s * dt
            P = F @ P @ F.T
            P[THETA, THETA] += q[0]
            P[V, V] += q_speed[i]
            P[LEAK, LEAK] += q[1]
        h = np.zeros(7)
        h[THETA] = 1.0
        P = _posterior(P, h, R[1])
        if ranged[i]:
            r = np.hypot(path[i, 0], path[i, 1])
            h = np.zeros(7)
            h[X], h[Y] = path[i, 0] / r, path[i, 1] / r
            P = _posterior(P, h, R[0])
        if rest[i]:
            h = np.zeros(7)
            h[V] = 1.0
            P = _posterior(P, h, R[2])
        bound[i] = P[X, X] + P[Y, Y]
    return bound


@njit(cache=True)
def _posterior(P: Array, h: Array, R: float) -> Array:
    K = P @ h / (h @ P @ h + R)
    A = np.eye(len(h)) - np.outer(K, h)
    return A @ P @ A.T + R * np.outer(K, K)
