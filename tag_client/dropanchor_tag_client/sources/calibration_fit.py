"""Fit the calibration of an IMU to samples: rest for gyroscope and accelerometer, turns for the magnetometer.

The corrected magnetic field has a constant length in every orientation. So the raw one lies on an ellipsoid, which is
fitted by linear least squares (Li and Griffiths, "Least squares ellipsoid specific fitting", 2004, without their
constraint: a result that is no ellipsoid is rejected). Its centre is the hard iron, its shape the soft iron. A vehicle
that only turns in the plane gives an ellipse; then the vertical component stays as it is.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dropanchor_schemas.wire import ImuSample
from dropanchor_tag_client.calibration import Calibration

GRAVITY_MPS2 = 9.80665
REST_S = 3.0
_STILL_GYRO_RADPS, _STILL_ACC_MPS2 = 0.03, 0.25  # standard deviations while it rests
_MAX_BIAS_RADPS, _MAX_SCALE_ERROR, _MIN_REST = 0.2, 0.1, 30
_SPATIAL = 0.15  # least spread in the thinnest direction, of that in the widest, for an ellipsoid
_MIN_MAG, _SECTORS, _MAX_RESIDUAL = 150, 12, 0.08
_FIELD_UT = (10.0, 100.0)  # the Earth's is 25 to 65 µT, and 10 in the plane

Array = NDArray[np.float64]


class NotEnoughError(ValueError):
    """The samples do not determine a calibration. The message says what to do."""


@dataclass(frozen=True)
class MagFit:
    """offset: µT. matrix: (3, 3), determinant 1. residual: of the length, relative. is_spatial: not an ellipse."""

    offset: Array
    matrix: Array
    residual: float
    is_spatial: bool


def fit(samples: list[ImuSample]) -> Calibration:
    """Return the calibration. Raises NotEnoughError."""
    bias, scale = fit_rest(samples)
    mag = np.array([sample.mag for sample in samples if sample.mag is not None], float).reshape(-1, 3)
    if not len(mag):
        return Calibration(_vector(bias), scale)
    found = fit_mag(_spread_out(mag))
    rows = [_vector(row) for row in found.matrix]
    return Calibration(_vector(bias), scale, True, _vector(found.offset), (rows[0], rows[1], rows[2]))


def fit_rest(samples: list[ImuSample]) -> tuple[Array, float]:
    """Return gyroscope bias (3,) in rad/s and accelerometer scale of the stillest `REST_S`. Raises NotEnoughError."""
    t_s = np.array([sample.t_ns for sample in samples], np.int64) * 1e-9
    gyro = np.array([sample.gyro for sample in samples], float).reshape(-1, 3)
    acc = np.array([sample.acc for sample in samples], float).reshape(-1, 3)
    best: tuple[float, Array, float] | None = None
    begin = 0
    for end in range(1, len(t_s) + 1):
        while t_s[end - 1] - t_s[begin] > REST_S:
            begin += 1
        if end - begin < _MIN_REST or end % 10 or t_s[end - 1] - t_s[begin] < 0.9 * REST_S:
            continue
        part = slice(begin, end)
        moves = max(gyro[part].std(0).max() / _STILL_GYRO_RADPS, acc[part].std(0).max() / _STILL_ACC_MPS2)
        bias, length = gyro[part].mean(0), float(np.linalg.norm(acc[part].mean(0)))
        plausible = np.abs(bias).max() < _MAX_BIAS_RADPS and abs(length / GRAVITY_MPS2 - 1) < _MAX_SCALE_ERROR
        if moves < 1 and plausible and (best is None or moves < best[0]):
            best = moves, bias, GRAVITY_MPS2 / length
    if best is None:
        raise NotEnoughError(f"the tag did not rest: {_why_no_rest(t_s, gyro, acc)}")
    return best[1], best[2]


def _why_no_rest(t_s: NDArray[np.floating], gyro: Array, acc: Array) -> str:
    """Return what the newest `REST_S` lack, and what to do."""
    if not len(t_s):
        return "no IMU sample arrived"
    newest = t_s >= t_s[-1] - REST_S
    if t_s[-1] - t_s[0] < 0.9 * REST_S:
        return f"the samples cover {t_s[-1] - t_s[0]:.1f} s by their times; leave it alone for {REST_S:.0f} s"
    if newest.sum() < _MIN_REST:
        return f"{newest.sum() / REST_S:.0f} samples per second are too few; {_MIN_REST / REST_S:.0f} are needed"
    turns, shakes = gyro[newest].std(0).max(), acc[newest].std(0).max()
    if turns >= _STILL_GYRO_RADPS or shakes >= _STILL_ACC_MPS2:
        return (
            f"the gyroscope varies by {turns:.2f} rad/s and the acceleration by {shakes:.2f} m/s²; less than "
            f"{_STILL_GYRO_RADPS} and {_STILL_ACC_MPS2} is rest; leave it alone for {REST_S:.0f} s"
        )
    length, bias = float(np.linalg.norm(acc[newest].mean(0))), float(np.abs(gyro[newest].mean(0)).max())
    return (
        f"it reads {length:.2f} m/s² and {bias:.2f} rad/s; about {GRAVITY_MPS2:.1f} and less than {_MAX_BIAS_RADPS} "
        "are possible at rest; check the units"
    )


def fit_mag(mag: Array) -> MagFit:
    """Return hard and soft iron of magnetometer readings (n, 3), µT. Raises NotEnoughError."""
    if len(mag) < _MIN_MAG:
        raise NotEnoughError("turn the tag for longer, in all directions")
    spread = np.sqrt(np.linalg.eigvalsh(np.cov(mag.T)))
    is_spatial = bool(spread[0] > _SPATIAL * spread[2])
    axes = 3 if is_spatial else 2
    centre, shape = _ellipsoid(mag[:, :axes])
    points = (mag[:, :axes] - centre) @ shape.T
    lengths = np.linalg.norm(points, axis=1)
    residual = float(lengths.std() / lengths.mean())
    if residual > _MAX_RESIDUAL:
        raise NotEnoughError("the magnetic field changes from place to place: go away from iron and motors")
    if not _FIELD_UT[0] < lengths.mean() < _FIELD_UT[1]:
        raise NotEnoughError(f"a field of {lengths.mean():.0f} µT is not the Earth's: go away from iron and motors")
    _check_turns(points)
    offset, matrix = np.zeros(3), np.eye(3)
    offset[:axes], matrix[:axes, :axes] = centre, shape
    return MagFit(offset, matrix, residual, is_spatial)


def _spread_out(mag: Array) -> Array:
    """Return readings that are at least about 1 µT apart, so that a rest does not outweigh the turns."""
    spread: Array = mag[np.unique(np.round(mag), axis=0, return_index=True)[1]]
    return spread


def _ellipsoid(points: Array) -> tuple[Array, Array]:
    """Return centre and matrix (determinant 1) that make a sphere of points (n, 2 or 3) on an ellipsoid.

    Solve p'Ap + b'p = 1 for A and b by least squares, with p scaled to about 1.
    """
    middle, size = points.mean(0), float(points.std())
    p = (points - middle) / size
    dim = p.shape[1]
    pairs = [(i, j) for i in range(dim) for j in range(i, dim)]
    design = np.column_stack([p[:, i] * p[:, j] * (1 if i == j else 2) for i, j in pairs] + [p])
    solution = np.linalg.lstsq(design, np.ones(len(p)), rcond=None)[0]
    quadric = np.zeros((dim, dim))
    for value, (i, j) in zip(solution, pairs, strict=False):
        quadric[i, j] = quadric[j, i] = value
    if np.linalg.matrix_rank(quadric) < dim:
        raise NotEnoughError("turn the tag further, in all directions")
    centre = -0.5 * np.linalg.solve(quadric, solution[len(pairs) :])
    values, vectors = np.linalg.eigh(quadric / (1 + centre @ quadric @ centre))
    if values.min() <= 0 or values.max() > 25 * values.min():
        raise NotEnoughError("turn the tag further, in all directions: the readings do not form an ellipsoid yet")
    root = vectors @ np.diag(np.sqrt(values)) @ vectors.T
    return middle + size * centre, root / np.linalg.det(root) ** (1 / dim)


def _check_turns(points: Array) -> None:
    """Raise NotEnoughError unless the tag has turned through the whole circle."""
    sectors = np.floor(np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi) * _SECTORS).astype(int)
    missing = _SECTORS - len(np.unique(sectors % _SECTORS))
    if missing > 1:
        raise NotEnoughError(f"turn the tag further: {missing * 360 // _SECTORS} degrees of the circle are missing")


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
