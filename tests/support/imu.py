"""IMU samples of a known motion, and of the recordings with ground truth, for tests of the estimation."""

import gzip
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[Any]
G0 = 9.80665


@dataclass
class Motion:
    """Samples (n, 3) at t (n,) s in body axes, and the body -> ENU attitude they belong to."""

    t: Array
    acc: Array
    gyro: Array
    mag: Array
    attitude: Rotation

    def at(self, index: Array) -> "Motion":
        """Some of the samples: a mask or indices."""
        columns = self.t[index], self.acc[index], self.gyro[index], self.mag[index]
        return Motion(*columns, attitude=self.attitude[index])

    @property
    def yaw(self) -> Array:
        """(n,) rad, azimuth of the body x axis."""
        x = self.attitude.apply([1.0, 0.0, 0.0])
        return np.asarray(np.arctan2(x[:, 1], x[:, 0]))


def synthesise(
    t: Array,
    angles: Callable[[Array], Array],
    acceleration: Callable[[Array], Array] | None = None,
    field: tuple[float, float, float] = (0.0, 0.4, -0.9),
) -> Motion:
    """Perfect samples of yaw, pitch, roll = angles(t) (n, 3) rad and an ENU acceleration (n, 3) m/s²."""

    def attitude(at: Array) -> Rotation:
        return Rotation.from_euler("ZYX", angles(at))

    h = 1e-4
    body = attitude(t)
    gyro = (attitude(t - h).inv() * attitude(t + h)).as_rotvec() / (2 * h)
    a = np.zeros((len(t), 3)) if acceleration is None else acceleration(t)
    return Motion(
        t, body.inv().apply(a + np.array([0.0, 0.0, G0])), gyro, body.inv().apply(np.tile(field, (len(t), 1))), body
    )


def turning(t: Array, rate: float = 0.6, tilt: float = 0.15) -> Array:
    """Yaw, pitch, roll of a body that circles and sways."""
    return np.stack([rate * t, tilt * np.sin(1.3 * t), 0.7 * tilt * np.sin(0.9 * t + 1)], axis=1)


def wrapped(angle: Array) -> Array:
    """In [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


@dataclass
class Recording:
    """imu (n, 10): t_s, acc, gyro, mag (NaN: none); truth columns by name."""

    imu: Array
    truth: dict[str, Array]

    def yaw_at(self, t: Array) -> Array:
        """rad, interpolated without a jump at pi."""
        return np.interp(t, self.truth["t_s"], np.unwrap(self.truth["yaw_rad"]))

    def speed_at(self, t: Array) -> Array:
        """m/s over 0.4 s."""
        moved = [
            np.interp(t + 0.2, self.truth["t_s"], self.truth[c]) - np.interp(t - 0.2, self.truth["t_s"], self.truth[c])
            for c in "xy"
        ]
        return np.hypot(*moved) / 0.4


def read_columns(path: Path) -> dict[str, Array]:
    """A gzipped CSV of numbers by column."""
    with gzip.open(path, "rt") as lines:
        names = lines.readline().strip().split(",")
        table = np.loadtxt(lines, delimiter=",")
    return dict(zip(names, table.T, strict=True))


def recording(name: str) -> Recording:
    """The recording, or a skip that says where it was looked for."""
    default = Path(__file__).parents[3] / "shared" / "data"
    folder = Path(os.environ.get("DROPANCHOR_DATA", default)) / name
    if not (folder / "imu.csv.gz").exists():
        pytest.skip(f"no recording {name} in {folder.parent}")
    columns = read_columns(folder / "imu.csv.gz")
    nothing = np.full(len(columns["t_s"]), np.nan)
    names = ["t_s", "ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz"]
    return Recording(np.stack([columns.get(c, nothing) for c in names], 1), read_columns(folder / "truth.csv.gz"))
