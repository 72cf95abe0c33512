"""Whether a tag was turned on what carries it, as its IMU tells: no range and no setting does.

Whatever drives a bend forwards is accelerated to its left by its speed times its turn rate. Where that points in the
body frame is a quarter turn left of the course, whichever way the bend goes. Half a turn is not told: it may have
driven backwards.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array

BLOCK_S: Final = 0.2  # s, over which vibration cancels out
LEAST_TURN, MOST_TURN = 1.2, math.pi - 0.8  # rad, of the mounting angle
AS_TOLD: Final = 0.5  # rad, by which it may have differed before: bends of what slips or rolls point elsewhere
LEAST: Final = 0.5  # m/s² · rad/s · s, of bends before and after
COHERENT: Final = 0.85  # share of the accelerations in bends that point the same way
NEARLY: Final = 0.98  # of the best moment to divide at: no bend was driven in between
TURN: Final = np.ones(5)  # blocks, about as long as somebody turns a tag


class Turned(NamedTuple):
    """t_ns: about when. before, after: mounting angles, rad: course minus body yaw."""

    t_ns: int
    before: float
    after: float


def turned(t_ns: Array, acc: Array, gyro: Array, told: float | None) -> Turned | None:
    """Return when a tag was turned about the vertical; None if it was not, or bends do not tell.

    t_ns (n,): when each sample arrived. acc, gyro (n, 3): body frame. told: the mounting angle, None: nobody told it.
    """
    size = _block_size(t_ns)
    if not size or len(t_ns) < 2 * size:
        return None
    flat, rate = _in_the_plane(_means(acc, size), _means(gyro, size))
    bends = flat * rate[:, None] * BLOCK_S
    sums, lengths = np.cumsum(bends, axis=0), np.cumsum(np.hypot(*bends.T))
    after, left = sums[-1] - sums, lengths[-1] - lengths
    scores = np.hypot(*sums.T) + np.hypot(*after.T)
    place = int(np.argmax(scores))
    if _tells(sums[place], lengths[place]) and _tells(after[place], left[place]):
        angles = _mount_of(sums[place]), _mount_of(after[place])
        if _differ(*angles) and (told is None or abs(_wrapped(angles[0] - told)) < AS_TOLD):
            sign = np.sign(_wrapped(angles[0] - angles[1]))  # of the body's turn, against an unchanged course
            when = np.where(scores >= NEARLY * scores.max(), np.convolve(sign * rate, TURN, "same"), -np.inf)
            return Turned(int(t_ns[int(np.argmax(when)) * size]), *angles)
    return None


def _differ(before: float, after: float) -> bool:
    return LEAST_TURN < abs(_wrapped(after - before)) < MOST_TURN


def _wrapped(angle: float) -> float:
    return math.remainder(angle, math.tau)


def _block_size(t_ns: Array) -> int:
    """Return how many samples make a block; 0 without any."""
    seconds = 0.0 if len(t_ns) < 2 else float(t_ns[-1] - t_ns[0]) * 1e-9
    return max(1, round(BLOCK_S * len(t_ns) / seconds)) if seconds > 0.0 else 0


def _means(samples: Array, size: int) -> Array:
    means: Array = samples[: len(samples) // size * size].reshape(-1, size, 3).mean(axis=1)
    return means


def _in_the_plane(acc: Array, gyro: Array) -> tuple[Array, Array]:
    """Return forward and leftward acceleration of the body without gravity, (n, 2), and its turn rate, (n,)."""
    mean = acc.mean(axis=0)
    up = mean / np.linalg.norm(mean)
    forward = np.array([1.0, 0.0, 0.0]) - up[0] * up
    forward /= np.linalg.norm(forward)
    return (acc - mean) @ np.stack([forward, np.cross(up, forward)], axis=1), gyro @ up


def _tells(total: Array, length: float) -> bool:
    return bool(np.hypot(*total) > max(LEAST, COHERENT * length))


def _mount_of(total: Array) -> float:
    """Return the mounting angle where `total` points a quarter turn left of the course."""
    return float(np.arctan2(-total[0], total[1]))
