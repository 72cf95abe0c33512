"""Motion of a differential drive in the plane: from segments to speed and yaw rate, and from these to the path.

Times in s, positions in m (east, north), angles in rad counter-clockwise from east, one row per instant.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Segment(NamedTuple):
    """A stretch of constant speed and yaw rate, reached over the first `ramp_s` along half a cosine.

    turn: additional change of course, rad, within the ramp, as a half-sine of yaw rate. With ramp_s = 0, speed and yaw
    rate change in one step.
    """

    duration_s: float
    speed: float
    yaw_rate: float = 0.0
    turn: float = 0.0
    ramp_s: float = 0.5


class Start(NamedTuple):
    """The start of a motion. course: direction of the vehicle's forward axis."""

    x: float
    y: float
    course: float
    t: float = 0.0
    travelled: float = 0.0


@dataclass(frozen=True)
class Trajectory:
    """A motion, as columns over time, all of shape (n,).

    course: direction of the forward axis, not wrapped. v: speed along it (negative: backwards). w: yaw rate.
    travelled: length of the path so far.
    """

    t: Array
    x: Array
    y: Array
    course: Array
    v: Array
    w: Array
    travelled: Array

    def __len__(self) -> int:
        return len(self.t)

    @property
    def dt(self) -> float:
        """Time between two rows, s. Rows are evenly spaced."""
        return float(self.t[-1] - self.t[0]) / (len(self) - 1)

    @property
    def distance(self) -> Array:
        """Distance to the origin, m."""
        return np.hypot(self.x, self.y)

    @property
    def end(self) -> Start:
        last = (self.x, self.y, self.course, self.t, self.travelled)
        return Start(*(float(column[-1]) for column in last))

    def at(self, times: Array) -> "Trajectory":
        """Return the motion at other times by linear interpolation. Outside, it keeps the values of its ends."""
        others = [np.interp(times, self.t, getattr(self, f.name)) for f in fields(self)[1:]]
        return Trajectory(times, *others)

    def after_rest(self, rest_s: float) -> "Trajectory":
        """Return the motion with an additional rest of `rest_s` at the start. The motion must start at rest."""
        dt = self.dt
        n = round(rest_s / dt)
        columns = [np.concatenate([np.full(n, getattr(self, f.name)[0]), getattr(self, f.name)]) for f in fields(self)]
        columns[0] = self.t[0] + dt * np.arange(n + len(self))
        return Trajectory(*columns)


def drive(segments: Iterable[Segment], start: Start, dt: float, previous: Segment | None = None) -> Trajectory:
    """Return the path of consecutive segments. They continue `previous`, or start from rest.

    The first row is `start`. Durations are rounded to whole steps of `dt`.
    """
    before = previous or Segment(0.0, 0.0)
    v, w = [np.array([before.speed])], [np.array([before.yaw_rate])]
    for segment in segments:
        eased = _ease(segment, before, dt)
        v.append(eased[0])
        w.append(eased[1])
        before = segment
    return integrate(np.concatenate(v), np.concatenate(w), start, dt)


def _ease(segment: Segment, before: Segment, dt: float) -> tuple[Array, Array]:
    tau = dt * np.arange(1, round(segment.duration_s / dt) + 1)
    u = np.minimum(tau / segment.ramp_s, 1.0) if segment.ramp_s > 0 else np.ones_like(tau)
    share = (1 - np.cos(math.pi * u)) / 2
    v = before.speed + (segment.speed - before.speed) * share
    w = before.yaw_rate + (segment.yaw_rate - before.yaw_rate) * share
    if segment.turn:
        w = w + segment.turn * math.pi / (2 * segment.ramp_s) * np.sin(math.pi * u)
    return v, w


def joined(first: Trajectory, then: Trajectory) -> Trajectory:
    """Join two stretches. The first row of the second must equal the last row of the first."""
    columns = [np.concatenate([getattr(first, f.name), getattr(then, f.name)[1:]]) for f in fields(first)]
    return Trajectory(*columns)


def integrate(v: Array, w: Array, start: Start, dt: float) -> Trajectory:
    """Return the path of the speed v and the yaw rate w, both (n,) at intervals of `dt`.

    Each step is the chord of an arc with the mean speed and the mean yaw rate of its ends, so arcs are exact.
    """
    angle = dt * (w[1:] + w[:-1]) / 2
    way = dt * (v[1:] + v[:-1]) / 2
    course = start.course + _running_sum(angle)
    chord = way * np.sinc(angle / (2 * math.pi))
    along = course[:-1] + angle / 2
    t = start.t + dt * np.arange(len(v), dtype=np.float64)
    return Trajectory(
        t=t,
        x=start.x + _running_sum(chord * np.cos(along)),
        y=start.y + _running_sum(chord * np.sin(along)),
        course=course,
        v=v,
        w=w,
        travelled=start.travelled + _running_sum(np.abs(way)),
    )


def _running_sum(steps: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(steps)])
