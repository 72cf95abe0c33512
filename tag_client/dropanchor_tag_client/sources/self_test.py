"""Find out from three motions which axis of an IMU points where."""

import math
from collections.abc import Callable, Iterable, Iterator

from dropanchor_schemas.wire import Vector
from dropanchor_tag_client.sources.axes import AXES, direction, mounting
from dropanchor_tag_client.sources.chips import Reading

_WINDOW = 25  # readings
_GRAVITY, _TOLERANCE = 9.81, 1.0  # m/s²
_LEVEL, _RAISED = 0.9, 0.34  # cosine of 26°, sine of 20°
_STILL_RADPS = 0.15
_TURNED_RAD = 1.0


def self_test(readings: Iterable[Reading], rate_hz: float, say: Callable[[str], None]) -> str:
    """Guide a person through three motions. Return the options that describe how the IMU is mounted."""
    stream = iter(readings)
    say("1 of 3: put the tag down level and leave it alone.")
    up = _up_axis(stream)
    say(f"axis {up} points up. 2 of 3: raise the front by about 45 degrees, and hold it.")
    forward = _raised_axis(stream, up)
    say(f"axis {forward} points forward. 3 of 3: put it down, and turn it to the left by about 90 degrees.")
    turned_rad = _turned(stream, up, 1.0 / rate_hz)
    mounted = mounting(forward, up)
    left = AXES[[direction(axis) for axis in AXES].index(mounted.left)]
    if turned_rad < 0:
        say("the gyroscope saw a turn to the right. If you turned left, it is wired or mirrored wrongly.")
    say(f"forward {forward}, left {left}, up {up}")
    return f"--forward={forward} --up={up}"


def _up_axis(stream: Iterator[Reading]) -> str:
    while True:
        gravity = _still_gravity(stream)
        axis, share = _largest(gravity)
        if share > _LEVEL:
            return axis


def _raised_axis(stream: Iterator[Reading], up: str) -> str:
    """Return the axis that gained specific force: gravity now points along it."""
    while True:
        gravity = _still_gravity(stream)
        level = [0.0 if abs(one) else part for one, part in zip(direction(up), gravity, strict=True)]
        axis, _ = _largest((level[0], level[1], level[2]))
        if math.hypot(*level) / math.hypot(*gravity) > _RAISED:
            return axis


def _turned(stream: Iterator[Reading], up: str, period_s: float) -> float:
    """Return the angle about the vertical once it is large, rad; counter-clockwise is positive."""
    angle_rad = 0.0
    while abs(angle_rad) < _TURNED_RAD:
        reading = next(stream)
        if math.hypot(*reading.gyro) > _STILL_RADPS:
            angle_rad += period_s * sum(a * b for a, b in zip(direction(up), reading.gyro, strict=True))
    return angle_rad


def _still_gravity(stream: Iterator[Reading]) -> Vector:
    """Return the mean acceleration of the next window in which the IMU rests."""
    while True:
        window = [next(stream) for _ in range(_WINDOW)]
        x, y, z = (sum(reading.acc[axis] for reading in window) / _WINDOW for axis in range(3))
        turns = max(math.hypot(*reading.gyro) for reading in window)
        if turns < _STILL_RADPS and abs(math.hypot(x, y, z) - _GRAVITY) < _TOLERANCE:
            return x, y, z


def _largest(vector: Vector) -> tuple[str, float]:
    """Return the axis with the largest component, and its share of the length."""
    axis = max(range(3), key=lambda index: abs(vector[index]))
    return AXES[2 * axis + (vector[axis] < 0)], abs(vector[axis]) / (math.hypot(*vector) or 1.0)
