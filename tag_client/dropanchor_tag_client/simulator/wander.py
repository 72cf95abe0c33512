"""Endless motions around an anchor at the origin, for live demonstrations: vehicles, carts and people in a yard.

A mover follows an arc until it points at its next target, then goes straight to it. Sometimes it stops there. Motions
are generated leg by leg, so they can run for hours.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dropanchor_tag_client.simulator.trajectory import Segment, Start, Trajectory, drive

Range = tuple[float, float]
Point = tuple[float, float]

REST_S = 2.5
RADIUS_M = 40.0
MIN_DISTANCE_M = 1.0
STEER_S = 0.6
ACCELERATION = 1.5
TRIALS = 20


@dataclass(frozen=True)
class Habit:
    """Parameters of a mover. Speeds (m/s), lengths (m) and durations (s) are uniform within their ranges.

    route: repeated sequence of targets; without one, random targets in a ring with the radii `ring`.
    pause_share: share of the targets at which it stops.
    """

    speed: Range
    turn_radius: Range
    pause_share: float
    pause_s: Range
    ring: Range = (4.0, 34.0)
    route: tuple[Point, ...] = ()


# In the order of the tags. The first six to eight look good together on one map.
HABITS: tuple[Habit, ...] = (
    Habit((1.5, 2.6), (2.0, 3.0), 0.35, (3.0, 8.0), ring=(5.0, 24.0)),  # forklift
    Habit((0.8, 1.4), (0.8, 1.4), 0.4, (2.0, 10.0), ring=(3.0, 18.0)),  # person
    Habit((2.5, 3.5), (5.0, 6.0), 0.2, (5.0, 10.0), route=((20, 14), (-20, 14), (-20, -14), (20, -14))),  # truck
    Habit((1.0, 1.2), (1.2, 1.5), 0.25, (2.0, 4.0), route=((10, -9), (27, -9), (27, -14), (10, -14))),  # patrol
    Habit((1.4, 1.8), (2.0, 2.5), 0.15, (3.0, 6.0), route=((-30, 5), (-10, 16), (-10, 5), (-30, 16))),  # bow tie
    Habit(
        (0.6, 0.8),
        (1.2, 1.3),
        0.1,
        (4.0, 8.0),
        route=tuple(  # mower, lane by lane
            (x, -6.0 - 2.5 * lane) for lane in range(6) for x in ((-26.0, -9.0) if lane % 2 else (-9.0, -26.0))
        ),
    ),
    Habit((3.5, 5.0), (4.0, 6.0), 0.1, (3.0, 6.0), ring=(14.0, 34.0)),  # bicycle
    Habit((0.5, 1.0), (0.8, 1.2), 0.6, (4.0, 15.0), ring=(2.0, 12.0)),  # person who often stops
)


class Wanderer:
    """A mover with an endless motion, generated in stretches. Each starts with the last row of the previous one."""

    def __init__(self, habit: Habit, rng: np.random.Generator, dt: float) -> None:
        self._habit = habit
        self._rng = rng
        self._dt = dt
        self._next_target = int(rng.integers(len(habit.route))) if habit.route else 0
        first, second = self._target(), self._target()
        course = math.atan2(second[1] - first[1], second[0] - first[0])
        self._next_target -= 1  # the second target is the first destination
        self._at = Start(*first, course, t=-dt)
        self._last = Segment(0.0, 0.0)
        self.start = Start(*first, course)

    def motions(self) -> Iterator[Trajectory]:
        """Yield the rest at the start, then leg after leg. The very first row lies one step before t = 0."""
        yield self._go([Segment(REST_S + self._dt, 0.0)])
        while True:
            yield self._go(self._leg())

    def _go(self, segments: list[Segment]) -> Trajectory:
        motion = drive(segments, self._at, self._dt, self._last)
        self._at, self._last = motion.end, segments[-1]
        return motion

    def _leg(self) -> list[Segment]:
        """Return a next leg that stays clear of the anchor and within the yard."""
        for _ in range(TRIALS):
            segments = self._towards(self._target())
            if segments and self._is_clear(segments):
                return segments
        return self._turn_on_the_spot()

    def _towards(self, target: Point) -> list[Segment] | None:
        """Return the segments to a target, or None if it lies within the turning circle."""
        speed = self._last.speed or self._rng.uniform(*self._habit.speed)
        begin = [] if self._last.speed else [Segment(_ramp(speed), speed, ramp_s=_ramp(speed))]
        run_up = speed * _ramp(speed) / 2 if begin else 0.0
        here = _ahead(self._at, run_up)
        arc = steer(here, target, self._rng.uniform(*self._habit.turn_radius))
        if arc is None:
            return None
        angle, radius, way = arc
        segments = [*begin, *_steering(angle, speed, radius), Segment(STEER_S + way / speed, speed, ramp_s=STEER_S)]
        if self._rng.random() < self._habit.pause_share:
            pause = self._rng.uniform(*self._habit.pause_s)
            segments.append(Segment(_ramp(speed) + pause, 0.0, ramp_s=_ramp(speed)))
        return segments

    def _turn_on_the_spot(self) -> list[Segment]:
        """Return the segments that stop, turn to a target with a free path, and go there."""
        stop_s = _ramp(self._last.speed)
        stop = [] if not self._last.speed else [Segment(stop_s + 1.0, 0.0, ramp_s=stop_s)]
        here = drive(stop, self._at, self._dt, self._last).end
        while True:
            target = self._target()
            turn = math.remainder(math.atan2(target[1] - here.y, target[0] - here.x) - here.course, math.tau)
            turn_s = 1.0 + abs(turn)
            segments = [*stop, Segment(turn_s, 0.0, turn=turn, ramp_s=turn_s), *self._straight(here, target)]
            if self._is_clear(segments):
                return segments

    def _straight(self, here: Start, target: Point) -> list[Segment]:
        way = math.dist((here.x, here.y), target)
        speed = self._habit.speed[0]
        ramp = _ramp(speed)
        return [Segment(max(ramp, way / speed), speed, ramp_s=ramp), Segment(ramp + 1.0, 0.0, ramp_s=ramp)]

    def _is_clear(self, segments: list[Segment]) -> bool:
        """Return whether the leg, and a stop after it, stay clear of the anchor and within the yard."""
        stop_s = _ramp(segments[-1].speed)
        stop = Segment(stop_s, 0.0, ramp_s=stop_s)
        distance = drive([*segments, stop], self._at, self._dt, self._last).distance
        return bool(distance.min() > MIN_DISTANCE_M and distance.max() < RADIUS_M)

    def _target(self) -> Point:
        if self._habit.route:
            target = self._habit.route[self._next_target % len(self._habit.route)]
            self._next_target += 1
            return target
        radius, bearing = self._rng.uniform(*self._habit.ring), self._rng.uniform(-math.pi, math.pi)
        return radius * math.cos(bearing), radius * math.sin(bearing)


def steer(here: Start, target: Point, radius: float) -> tuple[float, float, float] | None:
    """Return the path to the target as (angle, radius, way): an arc through `angle`, rad, then `way` m straight.

    The arc turns to the side of the target. Return None if the target lies within the turning circle.
    """
    bearing = math.atan2(target[1] - here.y, target[0] - here.x)
    side = math.copysign(1.0, math.remainder(bearing - here.course, math.tau))
    centre = (
        here.x - side * radius * math.sin(here.course),
        here.y + side * radius * math.cos(here.course),
    )
    apart = math.dist(centre, target)
    if apart <= radius:
        return None
    way = math.sqrt(apart * apart - radius * radius)
    leaving = math.atan2(target[1] - centre[1], target[0] - centre[0]) + side * math.atan2(radius, way)
    return side * (side * (leaving - here.course) % math.tau), radius, way


def _steering(angle: float, speed: float, radius: float) -> list[Segment]:
    """Return the segments of the arc. A short arc becomes one smooth turn."""
    rate = math.copysign(speed / radius, angle)
    if angle / rate < 2 * STEER_S:
        turn_s = max(STEER_S, math.pi / 2 * angle / rate)  # the peak yaw rate equals that of the arc
        return [Segment(turn_s, speed, turn=angle, ramp_s=turn_s)]
    return [Segment(angle / rate, speed, rate, ramp_s=STEER_S)]


def _ramp(speed: float) -> float:
    """Return the time to reach a speed, s."""
    return STEER_S + abs(speed) / ACCELERATION


def _ahead(here: Start, way: float) -> Start:
    return here._replace(x=here.x + way * math.cos(here.course), y=here.y + way * math.sin(here.course))
