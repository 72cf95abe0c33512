"""The posterior Cramér-Rao bound of the position (Tichavský, Muravchik and Nehorai 1998) on the true path of a run.

With additive Gaussian noise, the recursion J' = (Q + F J⁻¹ Fᵀ)⁻¹ + Hᵀ R⁻¹ H is that of a Kalman filter's covariance
with the Jacobians at the truth, in the covariance form, which allows a singular Q: that of `bounds/recursion`.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dropanchor_evaluation.bounds.linear import LinearModel
from dropanchor_service.estimation.columns import Array

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
    dt = (path.t[-1] - path.t[0]) / (len(path.t) - 1)
    spread = information == "range+heading, random-walk speed"
    m = LinearModel(len(path.t))
    m.state("x", s.start)
    m.state("y", s.start)
    m.state("heading", s.start_heading, (s.gyro * dt) ** 2)
    m.state("speed", s.start_speed, (s.acceleration * dt) ** 2 if accelerometer else _jump_power(path.v, spread))
    m.state("gyro bias", s.gyro_bias)
    m.move("heading", "gyro bias", -dt)
    c, w, v = (np.roll(column, 1) * dt for column in (np.cos(path.course), np.sin(path.course), path.v))
    m.move("x", "heading", -v * w / dt)
    m.move("x", "speed", c)
    m.move("y", "heading", v * c / dt)
    m.move("y", "speed", w)
    m.observe(s.heading, {"heading": 1.0})
    r = np.where(path.ranged, np.hypot(path.x, path.y), 1.0)
    m.observe(s.range, {"x": path.x / r, "y": path.y / r}, path.ranged)
    if accelerometer:
        m.state("acceleration bias", s.acceleration_bias)
        m.move("speed", "acceleration bias", -dt)
        m.gauss_markov("leak", s.leak, s.leak_tau_s, dt)
        m.move("speed", "leak", -dt)
        m.observe(s.zero_speed, {"speed": 1.0}, np.abs(path.v) < AT_REST_MPS)
    return m.bound(draws=0, seed=0).position


def _jump_power(v: Array, spread: bool) -> Array:
    """Return the variance of the speed change in each step, (n,): the squared true changes, spread over their ramps."""
    changing = np.diff(v, prepend=v[0]) != 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], changing, [False]]).astype(int)))
    power = np.full(len(v), 1e-10)
    for first, last in edges.reshape(-1, 2):
        power[first:last] += (v[last - 1] - v[max(first - 1, 0)]) ** 2 / (last - first)
    return np.full(len(v), power.mean()) if spread else power
