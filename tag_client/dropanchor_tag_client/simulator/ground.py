"""Ground vehicles that are hard to track: a trolley without vibration, and a forklift that reverses."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from dropanchor_tag_client.simulator.families import DT, REST_S, Range
from dropanchor_tag_client.simulator.sensors import SensorModels
from dropanchor_tag_client.simulator.trajectory import Segment, Start, Trajectory, drive


@dataclass(frozen=True)
class Rolling:
    """A trolley on a smooth floor: long legs, straight or slightly curved, with ramps of 2 s and no vibration."""

    speed: Range = (0.3, 1.5)
    leg_s: Range = (8.0, 14.0)
    turn: Range = (0.3, 1.6)
    bend: Range = (-0.1, 0.1)
    ramp_s: float = 2.0
    count: int = 5

    def draw(self, rng: np.random.Generator) -> Trajectory:
        return _drive_from_start(self._segments(rng), rng)

    def _segments(self, rng: np.random.Generator) -> Iterator[Segment]:
        yield Segment(REST_S, 0.0)
        for leg in range(self.count):
            turn = _either_sign(rng, self.turn) if leg else 0.0
            bend = rng.uniform(*self.bend) if rng.random() < 0.5 else 0.0
            yield Segment(rng.uniform(*self.leg_s), rng.uniform(*self.speed), bend, turn, self.ramp_s)


@dataclass(frozen=True)
class Forklift:
    """A forklift that drives ahead, stops, reverses in a curve, stops, and drives on, without turning round."""

    speed: Range = (1.0, 2.6)
    reverse_speed: Range = (0.5, 1.2)
    leg_s: Range = (6.0, 10.0)
    reverse_s: Range = (3.0, 6.0)
    stop_s: Range = (1.0, 4.0)
    turn: Range = (0.3, 1.6)
    reverse_rate: Range = (0.1, 0.35)
    ramp_s: float = 1.0
    count: int = 4

    def draw(self, rng: np.random.Generator) -> Trajectory:
        return _drive_from_start(self._segments(rng), rng)

    def _segments(self, rng: np.random.Generator) -> Iterator[Segment]:
        yield Segment(REST_S, 0.0)
        for leg in range(self.count):
            turn = _either_sign(rng, self.turn) if leg else 0.0
            yield Segment(rng.uniform(*self.leg_s), rng.uniform(*self.speed), 0.0, turn, self.ramp_s)
            yield self._stop(rng)
            back = -rng.uniform(*self.reverse_speed)
            yield Segment(rng.uniform(*self.reverse_s), back, _either_sign(rng, self.reverse_rate), 0.0, self.ramp_s)
            yield self._stop(rng)

    def _stop(self, rng: np.random.Generator) -> Segment:
        return Segment(self.ramp_s + rng.uniform(*self.stop_s), 0.0, ramp_s=self.ramp_s)


def smooth(models: SensorModels) -> SensorModels:
    """Return the sensors on a body without vibration: 0.05 m/s² and 0.003 rad/s of noise, moving and at rest."""
    imu = replace(
        models.imu,
        acc_std=0.05,
        gyro_std=0.003,
        vibration_acc=0.0,
        vibration_gyro=0.0,
        rocking_std=0.002,
    )
    return replace(models, imu=imu)


def _drive_from_start(segments: Iterator[Segment], rng: np.random.Generator) -> Trajectory:
    """Drive 10 m east of the origin, with a random heading."""
    return drive(segments, Start(10.0, 0.0, rng.uniform(-math.pi, math.pi)), DT)


def _either_sign(rng: np.random.Generator, magnitude: Range) -> float:
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(*magnitude))
