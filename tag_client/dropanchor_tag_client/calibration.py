"""The calibration of a tag's IMU: written by `dropanchor-tag calibrate`, applied by the client.

All vectors are in the axes of the tag: x forward, y left, z up.
"""

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

from dropanchor_schemas.wire import ImuSample, Vector

FILE_NAME = "imu_calibration.json"
_IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_VERSION = 1


class CalibrationError(ValueError):
    """The file is not a calibration. The message says what to do."""


class Calibration(NamedTuple):
    """acc_scale: factor. mag_offset_ut: hard iron. mag_matrix: undoes soft iron; its determinant is 1.

    has_mag: whether the magnetometer was calibrated.
    """

    gyro_bias_radps: Vector = (0.0, 0.0, 0.0)
    acc_scale: float = 1.0
    has_mag: bool = False
    mag_offset_ut: Vector = (0.0, 0.0, 0.0)
    mag_matrix: tuple[Vector, Vector, Vector] = _IDENTITY

    @property
    def label(self) -> str:
        """Return what says in the encoding of a message that its samples are calibrated."""
        return "calibrated=gyro+acc+mag" if self.has_mag else "calibrated=gyro+acc"

    def applied(self, sample: ImuSample) -> ImuSample:
        """Return the sample without the known errors of the sensors."""
        (ax, ay, az), (gx, gy, gz), (bx, by, bz) = sample.acc, sample.gyro, self.gyro_bias_radps
        scale = self.acc_scale
        return ImuSample(
            sample.t_ns,
            (ax * scale, ay * scale, az * scale),
            (gx - bx, gy - by, gz - bz),
            None if sample.mag is None else self._mag(sample.mag),
        )

    def _mag(self, mag: Vector) -> Vector:
        (x, y, z), (ox, oy, oz) = mag, self.mag_offset_ut
        x, y, z = x - ox, y - oy, z - oz
        (a, b, c), (d, e, f), (g, h, i) = self.mag_matrix
        return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def read_calibration(folder: str | Path) -> Calibration | None:
    """Return the calibration in the folder of a tag, None if there is none. Raises CalibrationError."""
    path = Path(folder, FILE_NAME)
    try:
        value = json.loads(path.read_bytes())
        if value.pop("version") != _VERSION:
            raise ValueError("version")
        return _calibration(value)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise CalibrationError(f"{path} is damaged ({error}): run `dropanchor-tag calibrate` again") from error


def write_calibration(folder: str | Path, calibration: Calibration) -> Path:
    """Write the calibration into the folder of a tag, and return the path of the file. Raises OSError."""
    path = Path(folder, FILE_NAME)
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_suffix(".new")
    new.write_text(json.dumps({"version": _VERSION, **calibration._asdict()}, indent=2) + "\n")
    new.replace(path)
    return path


def _calibration(value: dict[str, Any]) -> Calibration:
    rows = value.pop("mag_matrix")
    a, b, c = (_vector(row) for row in rows)
    found = Calibration(
        gyro_bias_radps=_vector(value.pop("gyro_bias_radps")),
        acc_scale=_number(value.pop("acc_scale")),
        has_mag=bool(value.pop("has_mag")),
        mag_offset_ut=_vector(value.pop("mag_offset_ut")),
        mag_matrix=(a, b, c),
    )
    if value:
        raise ValueError(f"unknown: {', '.join(value)}")
    return found


def _vector(values: Any) -> Vector:
    x, y, z = (_number(value) for value in values)
    return x, y, z


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{value!r} is no number")
    return float(value)
