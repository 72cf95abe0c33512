"""IMU samples of a tag with known errors: bias, scale, hard and soft iron."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dropanchor_schemas.wire import ImuSample, Vector

Array = NDArray[np.float64]
FIELD_UT = np.array([0.0, 20.0, -44.0])  # north and down
_RATE_HZ = 100
_PERIOD_NS = 1_000_000_000 // _RATE_HZ
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
    bodies = rotation(yaw, pitch, roll)
    moving = (np.arange(len(u)) >= rest)[:, None]
    noise = rng.standard_normal((3, len(u), 3))
    acc = bodies @ [0.0, 0.0, 9.80665] / errors.acc_scale + noise[0] * np.where(moving, 0.5, 0.03)
    gyro = np.where(moving, _rates(bodies), 0.0) + errors.gyro_bias + noise[1] * 0.003
    mag = bodies @ FIELD_UT @ shape.T + errors.hard_iron + noise[2] * errors.mag_noise_ut
    columns = [[(x, y, z) for x, y, z in column.tolist()] for column in (acc, gyro, mag)]
    times_ns = range(_T0_NS, _T0_NS + len(u) * _PERIOD_NS, _PERIOD_NS)
    return [ImuSample(*sample) for sample in zip(times_ns, *columns, strict=True)]


def rotation(yaw: float | Array, pitch: float | Array, roll: float | Array) -> Array:
    """Return the rotations from east-north-up to the body, (3, 3) or (n, 3, 3)."""
    angles = yaw, pitch, roll
    (cy, cp, cr), (sy, sp, sr) = map(np.cos, angles), map(np.sin, angles)
    no, one = np.zeros_like(cy), np.ones_like(cy)
    about_z = _matrices([[cy, sy, no], [-sy, cy, no], [no, no, one]])
    about_y = _matrices([[cp, no, -sp], [no, one, no], [sp, no, cp]])
    about_x = _matrices([[one, no, no], [no, cr, sr], [no, -sr, cr]])
    return about_x @ about_y @ about_z


def _matrices(rows: list[list[Array]]) -> Array:
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _rates(bodies: Array) -> Array:
    """Return how fast the body turns into each rotation, (n, 3), rad/s."""
    turned = np.roll(bodies, 1, axis=0) @ np.swapaxes(bodies, 1, 2)
    twice = [turned[:, 2, 1] - turned[:, 1, 2], turned[:, 0, 2] - turned[:, 2, 0], turned[:, 1, 0] - turned[:, 0, 1]]
    return np.stack(twice, axis=1) * _RATE_HZ / 2
