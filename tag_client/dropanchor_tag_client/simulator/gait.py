"""The motion of a device carried by a walking person: accelerations and rotations periodic in the step and the stride.

The figures below are medians over eight recorded walks with a real phone in the hand (50 Hz, 1 to 2 minutes each) and
over 20 simulated walks, evaluated in the same way. They are RMS values in bands around multiples of the step frequency,
recorded / simulated. Accelerations are in m/s², rates in rad/s. Gravity is the mean over 6 s:

    band               0.35 to 0.7  0.7 to 1.3   1.3 to 1.7   1.7 to 2.3   2.3 to 3.3   to 25 Hz
    upward             0.20 / 0.33  2.80 / 2.80  0.61 / 0.67  1.34 / 1.33  0.86 / 0.87  0.84 / 0.84
    forward            0.23 / 0.27  0.59 / 0.58  0.19 / 0.23  0.26 / 0.38  0.32 / 0.35  0.36 / 0.36
    leftward           0.38 / 0.40  0.31 / 0.35  0.28 / 0.27  0.21 / 0.20  0.25 / 0.25  0.30 / 0.27
    roll rate          0.07 / 0.07  0.08 / 0.08  0.05 / 0.05  0.06 / 0.06  0.07 / 0.07  0.11 / 0.09
    pitch rate         0.09 / 0.09  0.54 / 0.51  0.14 / 0.14  0.22 / 0.21  0.16 / 0.15  0.16 / 0.15
    yaw rate           0.17 / 0.20  0.09 / 0.09  0.05 / 0.05  0.06 / 0.05  0.05 / 0.05  0.06 / 0.05

Also matched: steps per second 1.84 / 1.82, speed while walking 1.23 / 1.20 m/s, RMS of the upward acceleration 3.5 /
3.4 m/s² (of single walks 3.0 to 4.9 / 2.6 to 5.4), its quantiles 1, 5, 95 and 99 % -5.7, -4.4, 6.5, 10.4 / -5.8,
-4.5, 6.6, 9.5 m/s², its kurtosis 5.4 / 4.6, the phase of the forward against the upward acceleration at the step
frequency 95° / 95° (with gravity in the pitching device), and the logarithm of Kim's step length over the real one
0.06 / 0.10. Simulated steps are more regular: their durations vary by 6 %, recorded ones by 10 to 15 %, with stops.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dropanchor_tag_client.simulator.noise import gauss_markov
from dropanchor_tag_client.simulator.trajectory import Array, Trajectory

MULTIPLES = np.array([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0])  # of the step frequency; 0.5: the stride
STEP_LENGTH = 0.362  # m per (m/s²)^⅓, of the peak-to-peak upward acceleration of a step (Kim)
PEAK_TO_PEAK = 7.3  # m/s², of a step at amplitude 1, fitted to the recorded accelerations


class Shape(NamedTuple):
    """Spectrum of one axis: RMS at each multiple of the step frequency.

    first, second: phase of the first and second multiple relative to the upward axis, rad; NaN: random.
    """

    rms: tuple[float, ...]
    first: float = math.nan
    second: float = math.nan


@dataclass(frozen=True)
class Shapes:
    """Accelerations along, left of and above the course, m/s², and rates of roll, pitch and yaw, rad/s.

    The forward acceleration excludes gravity, which is part of the recorded 0.59 m/s² at the step frequency because
    the device pitches. The phases at multiples 1 and 2 are the recorded ones; they distinguish forward from backward.
    """

    upward: Shape
    forward: Shape
    leftward: Shape
    roll: Shape
    pitch: Shape
    yaw: Shape


IN_HAND = Shapes(
    upward=Shape((0.2, 2.8, 0.6, 1.33, 0.86, 0.55, 0.45, 0.35), 0.0, 0.0),
    forward=Shape((0.2, 0.69, 0.19, 0.26, 0.32, 0.22, 0.2, 0.15), math.radians(54.0)),
    leftward=Shape((0.35, 0.31, 0.28, 0.21, 0.25, 0.2, 0.15, 0.1), math.radians(-104.0)),
    roll=Shape((0.07, 0.084, 0.05, 0.06, 0.073, 0.06, 0.06, 0.05)),
    pitch=Shape((0.09, 0.54, 0.14, 0.22, 0.16, 0.1, 0.09, 0.08), math.radians(86.0), math.radians(58.0)),
    yaw=Shape((0.17, 0.09, 0.05, 0.056, 0.051, 0.03, 0.03, 0.03)),
)


@dataclass(frozen=True)
class Walker:
    """The gait of one person.

    speed: usual speed, m/s. cadence: steps per second at that speed. stride_log: log of Kim's step length / real one.
    """

    speed: float
    cadence: float
    stride_log: float

    @property
    def amplitude(self) -> float:
        """Return the relative acceleration amplitude at the usual speed; PEAK_TO_PEAK is 1. From Kim's formula."""
        length = self.speed / self.cadence * math.exp(self.stride_log)
        return (length / STEP_LENGTH) ** 3 / PEAK_TO_PEAK


def draw_walker(rng: np.random.Generator) -> Walker:
    """Return a random person. Recorded: 1.07 to 1.38 m/s (median 1.23 while walking), 1.80 to 1.91 steps/s."""
    speed = float(np.clip(rng.normal(1.24, 0.09), 1.0, 1.45))
    cadence = float(1.84 + 0.15 * (speed - 1.24) + rng.normal(0.0, 0.035))
    return Walker(speed, cadence, float(rng.normal(0.05, 0.035)))


class Shaking(NamedTuple):
    """Columns (n,): accelerations along, left of and above the course, m/s², and angles added to the attitude, rad."""

    forward: Array
    leftward: Array
    upward: Array
    roll: Array
    pitch: Array
    yaw: Array


def shaking(motion: Trajectory, walker: Walker, shapes: Shapes, rng: np.random.Generator) -> Shaking:
    """Return the accelerations and angles that the steps add to the smooth motion.

    At a share q of the usual speed, the cadence and the step length are both scaled by √q, so the amplitude is q^1.5.
    The step frequency varies by 6 % and amplitudes by 25 %, both over half a second.
    """
    n, dt = len(motion), motion.dt
    q = np.clip(np.abs(motion.v) / walker.speed, 0.0, 1.3)
    unsteady = 1.0 + gauss_markov(rng, n, dt, 0.06, 0.5, 0.0)
    phase = 2 * np.pi * np.cumsum(walker.cadence * np.sqrt(q) * unsteady) * dt + rng.uniform(0.0, 4 * np.pi)
    size = walker.amplitude * q**1.5
    accelerations = (shapes.forward, shapes.leftward, shapes.upward)
    moved = [size * (1.0 + _slow(rng, n, dt)) * _sum(phase, shape, rng) for shape in accelerations]
    # The angles must be smooth, because a gyroscope measures their derivative.
    rate = 2 * np.pi * walker.cadence * MULTIPLES
    swung = [q**1.5 * _sum(phase, shape, rng, rate) for shape in (shapes.roll, shapes.pitch, shapes.yaw)]
    return Shaking(*moved, *swung)


def _slow(rng: np.random.Generator, n: int, dt: float) -> Array:
    return gauss_markov(rng, n, dt, 0.25, 0.5, 0.0)


def _sum(phase: Array, shape: Shape, rng: np.random.Generator, rate: Array | None = None) -> Array:
    """Return the sum of the multiples. With `rate` (rad/s of each): the angle whose derivative has this shape."""
    amplitude = math.sqrt(2.0) * np.asarray(shape.rms)
    shift = rng.uniform(-math.pi, math.pi, len(MULTIPLES))
    for index, known in ((1, shape.first), (3, shape.second)):
        if math.isfinite(known):
            shift[index] = known + rng.normal(0.0, 0.25)
    if shape.first == 0.0:  # upward axis: all multiples peak at the heel strike
        shift = rng.normal(0.0, 0.4, len(MULTIPLES))
    if rate is not None:
        amplitude, shift = amplitude / rate, shift - math.pi / 2
    waves: Array = np.cos(np.multiply.outer(phase, MULTIPLES) + shift)
    return waves @ amplitude
