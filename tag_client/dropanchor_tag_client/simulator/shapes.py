"""The motions of the paper (Cao et al., "Accurate position tracking with a single UWB anchor", ICRA 2020)."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from dropanchor_tag_client.simulator.trajectory import Array, Segment, Start, Trajectory, drive, integrate

Point = tuple[float, float]

# Stage values of the simulation that the authors released (github.com/MISTLab/RangeTracker, commit 3039e4a).
STAGES_DT = 0.005
STAGES_STEPS = 10_000
STAGE_STARTS = (1570, 3134, 4435, 6203, 7883)
STAGE_SPEEDS = (7.8, 3.8, 2.3, 5.2, 6.2)
STAGE_TURN_PEAKS = (4.7, 6.1, 3.5, 5.0, 7.1)
STAGE_CHANGE_STEPS = 50

# The paper shows Fig. 3 without values for its ten stages. These values are our own.
TEN_STAGES = (
    Segment(5.0, 2.0),
    Segment(5.0, 4.0, 0.30, 0.9),
    Segment(5.0, 1.0, -0.40, -0.7),
    Segment(5.0, 3.0, 0.20, 1.3),
    Segment(5.0, 5.0, -0.15, -1.1),
    Segment(5.0, 2.5, 0.50, 0.6),
    Segment(5.0, 0.8, -0.25, 1.5),
    Segment(5.0, 3.5, 0.35, -0.8),
    Segment(5.0, 1.5, -0.10, 1.0),
    Segment(5.0, 4.5, 0.25, -1.4),
)

# Centre lines of the letters, m, with the anchor at the bottom right as in the paper's Fig. 1.
TUM_CORNERS: tuple[Point, ...] = (
    *((-26.0, 11.0), (-20.0, 11.0), (-23.0, 11.0), (-23.0, 2.0)),
    *((-18.0, 11.0), (-18.0, 2.0), (-12.0, 2.0), (-12.0, 11.0)),
    *((-9.0, 2.0), (-9.0, 11.0), (-5.5, 6.0), (-2.0, 11.0), (-2.0, 2.0)),
)
TRIANGLE_CORNERS: tuple[Point, ...] = ((8.0, -6.0), (33.0, -6.0), (20.5, 15.65), (8.0, -6.0))


def paper_stages() -> Trajectory:
    """Return the motion of Table I: a rest, then five straight stages; 50 s at 200 Hz."""
    v, w = np.zeros(STAGES_STEPS + 1), np.zeros(STAGES_STEPS + 1)
    before = 0.0
    x = math.pi * np.arange(STAGE_CHANGE_STEPS) / STAGE_CHANGE_STEPS
    for first, speed, peak in zip(STAGE_STARTS, STAGE_SPEEDS, STAGE_TURN_PEAKS, strict=True):
        v[first:] = speed
        v[first : first + STAGE_CHANGE_STEPS] = before + np.sin(x / 2) * (speed - before)
        w[first : first + STAGE_CHANGE_STEPS] = peak * np.sin(x)
        before = speed
    return integrate(v, w, Start(10.0, 0.0, math.pi / 2), STAGES_DT)


def ten_stages(arcs: bool) -> Trajectory:
    """Return the motion of Fig. 3: ten stages of 5 s at 100 Hz. Speed and yaw rate change in one step.

    With arcs, the stages have yaw rates. Without, each stage is straight after a sudden change of course.
    """
    dt = 0.01
    v, w = [np.zeros(0)], [np.zeros(0)]
    for stage in TEN_STAGES:
        n = round(stage.duration_s / dt)
        v.append(np.full(n, stage.speed))
        w.append(np.full(n, stage.yaw_rate) if arcs else _sudden_turn(n, stage.turn, dt))
    return integrate(np.concatenate(v), np.concatenate(w), Start(10.0, 0.0, math.pi / 2), dt)


def _sudden_turn(n: int, turn: float, dt: float) -> Array:
    w = np.zeros(n)
    w[0] = turn / dt
    return w


def fig4_line() -> Trajectory:
    """Return the motion of Fig. 4: (10, 0) → (10, 250) at 10 m/s, 100 Hz."""
    n = 2501
    return integrate(np.full(n, 10.0), np.zeros(n), Start(10.0, 0.0, math.pi / 2), 0.01)


def triangle() -> Trajectory:
    """Return the motion of the drone: 10 s of hovering, then a triangle at 2 m/s, nose along the path. Our own size."""
    return polyline(TRIANGLE_CORNERS, speed=2.0, turn_s=2.0, rest_s=10.0)


def tum_letters() -> Trajectory:
    """Return the motion of the ground robot: the letters TUM, with turns on the spot at corners. Our own size."""
    return polyline(TUM_CORNERS, speed=0.8, turn_s=1.5, rest_s=3.0)


def polyline(corners: Sequence[Point], speed: float, turn_s: float, rest_s: float) -> Trajectory:
    """Return straight lines from corner to corner. At each corner the tag stops for turn_s + 0.5 s and turns."""
    segments = [Segment(rest_s, 0.0)]
    courses = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(corners)]
    course = courses[0]
    for (a, b), wanted in zip(pairwise(corners), courses, strict=True):
        if wanted != course:
            segments.append(Segment(turn_s, 0.0, turn=math.remainder(wanted - course, math.tau), ramp_s=turn_s))
        # Ramps of equal length at both ends: the leg covers speed · duration exactly.
        segments += [Segment(math.dist(a, b) / speed, speed), Segment(0.5, 0.0)]
        course = wanted
    return drive([*segments, Segment(1.0, 0.0)], Start(*corners[0], courses[0]), dt=0.01)
