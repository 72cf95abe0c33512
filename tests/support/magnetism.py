"""IMU samples of a tag with known errors: bias, scale, hard and soft iron."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dropanchor_schemas.wire import ImuSample, Vector

Array = NDArray[np.float64]
FIELD_UT = np.array([0.0, 20.0, -44.0])  # north and down
_RATE_HZ = 100
_T0_NS = 1_800_000_000_000_000_000


@dataclass(frozen=True)
class Errors:
    """soft_iron: symmetric (3, 3), determinant 1."""

    gyro_bias: Vector = (0.02, -0.03, 0.015)
    acc_scale: float = 1.02
    hard_iron: Vector = (30.0, -12.0, 8.0)
    soft_iron: Array | None = None
    mag_noise_ut: float = 0.3


def soft_iron() -> Array:
    matrix = np.array([[1.15, 0.08, -0.03], [0.08, 0.95, 0.05], [-0.03, 0.05, 0.93]])
    found: Array = matrix / np.linalg.det(matrix) ** (1 / 3)
    return found


def samples(
    errors: Errors, seed: int, *, turns: float = 3.0, tilt_rad: float = 1.0, rest_s: float = 5.0
) -> list[ImuSample]:
    """Return a rest, then `turns` turns about the vertical while the tag swings by `tilt_rad`."""
    rng = np.random.default_rng(seed)
    rest, motion = int(rest_s * _RATE_HZ), 40 * _RATE_HZ
    u = np.concatenate([np.zeros(rest), np.linspace(0.0, 1.0, motion)])
    yaw, roll, pitch = 2 * np.pi * turns * u, tilt_rad * np.sin(26 * u), tilt_rad * np.sin(41 * u)
    shape = soft_iron() if errors.soft_iron is None else errors.soft_iron
    found = []
    bodies = [rotation(*angles) for angles in zip(yaw, pitch, roll, strict=True)]
    for i, body_from_east in enumerate(bodies):
        moving = i >= rest
        rate = _rate(body_from_east, bodies[i - 1]) if moving else np.zeros(3)
        acc = body_from_east @ [0.0, 0.0, 9.80665] / errors.acc_scale + rng.normal(0, 0.5 if moving else 0.03, 3)
        gyro = rate + errors.gyro_bias + rng.normal(0, 0.003, 3)
        mag = shape @ (body_from_east @ FIELD_UT) + errors.hard_iron + rng.normal(0, errors.mag_noise_ut, 3)
        t_ns = _T0_NS + i * 1_000_000_000 // _RATE_HZ
        found.append(ImuSample(t_ns, _vector(acc), _vector(gyro), _vector(mag)))
    return found


def rotation(yaw: float, pitch: float, roll: float) -> Array:
    """Return the rotation from east-north-up to the body."""
    (cy, cp, cr), (sy, sp, sr) = np.cos([yaw, pitch, roll]), np.sin([yaw, pitch, roll])
    about_z = np.array([[cy, sy, 0], [-sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, sr], [0, -sr, cr]])
    found: Array = about_x @ about_y @ about_z
    return found


def _rate(now: Array, before: Array) -> Array:
    turned = before @ now.T
    return (
        np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]) * _RATE_HZ / 2
    )


def _vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
