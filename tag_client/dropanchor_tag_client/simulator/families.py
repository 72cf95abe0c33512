"""Families of random motions, one per seed. All start at rest at (10, 0)."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dropanchor_tag_client.simulator.noise import gauss_markov
from dropanchor_tag_client.simulator.trajectory import Array, Segment, Start, Trajectory, drive, integrate

DT = 0.01
REST_S = 1.0
RAMP_S = 0.5
TURN = (0.3, 2.2)
Range = tuple[float, float]


@dataclass(frozen=True)
class Legs:
    """A rest, then legs of constant speed. Speeds (m/s), durations (s) and yaw rates (rad/s) are uniform.

    Every straight leg except the first begins with a turn of ±U(0.3, 2.2) rad in 0.5 s.

    min_change: minimum speed difference between two legs.
    arc_probability: probability that a leg is an arc, with a yaw rate from arc_rate and no turn at its start.
    stop_s: duration of the stop before every leg except the first; None: no stops.
    backwards: indices of the legs that are driven in reverse.
    """

    speed: Range = (0.5, 4.0)
    leg_s: Range = (8.0, 14.0)
    min_change: float = 0.4
    arc_probability: float = 0.0
    arc_rate: Range = (0.1, 0.5)
    stop_s: Range | None = None
    backwards: tuple[int, ...] = ()
    count: int = 5

    def draw(self, rng: np.random.Generator) -> Trajectory:
        start = Start(10.0, 0.0, rng.uniform(-math.pi, math.pi))
        return drive(self._segments(rng), start, DT)

    def _segments(self, rng: np.random.Generator) -> Iterator[Segment]:
        yield Segment(REST_S, 0.0)
        speed = 0.0
        for leg in range(self.count):
            if self.stop_s and leg:
                yield Segment(RAMP_S + rng.uniform(*self.stop_s), 0.0, ramp_s=RAMP_S)
            speed = self._next_speed(rng, speed)
            yield self._leg(rng, leg, speed)

    def _next_speed(self, rng: np.random.Generator, previous: float) -> float:
        speed = rng.uniform(*self.speed)
        while abs(speed - previous) < self.min_change:
            speed = rng.uniform(*self.speed)
        return speed

    def _leg(self, rng: np.random.Generator, leg: int, speed: float) -> Segment:
        duration = rng.uniform(*self.leg_s)
        signed = -speed if leg in self.backwards else speed
        if rng.random() < self.arc_probability:
            return Segment(duration, signed, yaw_rate=_either_sign(rng, self.arc_rate), ramp_s=RAMP_S)
        turn = _either_sign(rng, TURN) if leg else 0.0
        return Segment(duration, signed, turn=turn, ramp_s=RAMP_S)


@dataclass(frozen=True)
class Wandering:
    """Motion whose speed and yaw rate are Ornstein-Uhlenbeck processes, from rest. The speed is clipped at 0."""

    duration_s: float = 60.0
    speed_mean: float = 1.5
    speed_std: float = 0.8
    speed_tau_s: float = 6.0
    rate_std: float = 0.35
    rate_tau_s: float = 4.0

    def draw(self, rng: np.random.Generator) -> Trajectory:
        start = Start(10.0, 0.0, rng.uniform(-math.pi, math.pi))
        n = round((self.duration_s - REST_S) / DT)
        about_mean = gauss_markov(rng, n, DT, self.speed_std, self.speed_tau_s, -self.speed_mean)
        v = np.maximum(self.speed_mean + about_mean, 0.0)
        w = gauss_markov(rng, n, DT, self.rate_std, self.rate_tau_s, 0.0)
        return integrate(_after_rest(v), _after_rest(w), start, DT)


@dataclass(frozen=True)
class Line:
    """One straight line."""

    speed: Range = (0.5, 4.0)
    duration_s: float = 40.0

    def draw(self, rng: np.random.Generator) -> Trajectory:
        start = Start(10.0, 0.0, rng.uniform(-math.pi, math.pi))
        return drive([Segment(REST_S, 0.0), Segment(self.duration_s, rng.uniform(*self.speed))], start, DT)


def _after_rest(column: Array) -> Array:
    return np.concatenate([np.zeros(round(REST_S / DT)), column])


def _either_sign(rng: np.random.Generator, magnitude: Range) -> float:
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(*magnitude))
