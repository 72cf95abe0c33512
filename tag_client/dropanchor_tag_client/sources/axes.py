"""How an IMU is mounted: which of its axes point forward and up."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from dropanchor_schemas.wire import Vector

AXES = ("x", "-x", "y", "-y", "z", "-z")
_SAMPLES = 50
_GRAVITY, _TOLERANCE, _CLEARLY = 9.81, 1.0, 8.5  # m/s²

_Direction = tuple[int, int, int]


class Mounting(NamedTuple):
    """Rows of the rotation from the axes of the sensor to those of the tag: x forward, y left, z up."""

    forward: _Direction
    left: _Direction
    up: _Direction

    def to_body(self, v: Sequence[float]) -> Vector:
        x, y, z = (sum(c * part for c, part in zip(row, v, strict=True)) for row in self)
        return x, y, z


def mounting(forward: str, up: str) -> Mounting:
    """Return the rotation of a sensor whose axis `forward` points forward and whose axis `up` points up.

    Raises ValueError when the two are not at right angles."""
    f, u = direction(forward), direction(up)
    left = (u[1] * f[2] - u[2] * f[1], u[2] * f[0] - u[0] * f[2], u[0] * f[1] - u[1] * f[0])
    if not any(left):
        raise ValueError(f"forward ({forward}) and up ({up}) must be different axes")
    return Mounting(f, left, u)


class UpAxis:
    """Finds out from gravity which axis of a sensor points up while it rests."""

    def __init__(self) -> None:
        self._sum = [0.0, 0.0, 0.0]
        self._count = 0

    def add(self, acc: Vector) -> str | None:
        """Return the axis that points up, once, after enough samples; None before, and while none clearly does."""
        self._count += 1
        self._sum = [total + part for total, part in zip(self._sum, acc, strict=True)]
        if self._count % _SAMPLES:
            return None
        mean = [total / _SAMPLES for total in self._sum]
        self._sum = [0.0, 0.0, 0.0]
        largest = max(range(3), key=lambda axis: abs(mean[axis]))
        still = abs(math.hypot(*mean) - _GRAVITY) < _TOLERANCE and abs(mean[largest]) > _CLEARLY
        return AXES[2 * largest + (mean[largest] < 0)] if still else None


def direction(axis: str) -> _Direction:
    sign = -1 if axis.startswith("-") else 1
    x, y, z = (sign * (axis[-1] == name) for name in "xyz")
    return x, y, z
