"""IMU samples of a known motion and of recordings with ground truth, for tests of the estimators."""

import gzip
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from support.recordings import recording_or_skip

Array = NDArray[Any]
G0 = 9.80665


@dataclass
class Motion:
    """Samples (n, 3) in body axes at the times t (n,) in s, and the true attitudes (ENU from body)."""

    t: Array
    acc: Array
    gyro: Array
    mag: Array
    attitude: Rotation

    def at(self, index: Array) -> "Motion":
        """Return the samples that a mask or an array of indices selects."""
        columns = self.t[index], self.acc[index], self.gyro[index], self.mag[index]
        return Motion(*columns, attitude=self.attitude[index])

    @property
    def yaw(self) -> Array:
        """Azimuth of the body x axis, (n,) rad."""
        x = self.attitude.apply([1.0, 0.0, 0.0])
        return np.asarray(np.arctan2(x[:, 1], x[:, 0]))


def synthesise(
    t: Array,
    angles: Callable[[Array], Array],
    acceleration: Callable[[Array], Array] | None = None,
    field: tuple[float, float, float] = (0.0, 0.4, -0.9),
) -> Motion:
    """Return noise-free samples of a motion.

    angles: yaw, pitch and roll at the times (n, 3), rad. acceleration: in ENU (n, 3), m/s²; None: at rest or constant
    speed. field: the magnetic field in ENU, in any unit.
    """

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
    """Return yaw, pitch and roll (n, 3) in rad of a body that circles at `rate` rad/s and sways by `tilt` rad."""
    return np.stack([rate * t, tilt * np.sin(1.3 * t), 0.7 * tilt * np.sin(0.9 * t + 1)], axis=1)


def wrapped(angle: Array) -> Array:
    """Return the angle in [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


@dataclass
class Recording:
    """imu: time in s, acc, gyro and mag (n, 10), NaN without a magnetometer. truth: columns by name."""

    imu: Array
    truth: dict[str, Array]

    def yaw_at(self, t: Array) -> Array:
        """Return the true yaw in rad, interpolated without a jump at pi."""
        return np.interp(t, self.truth["t_s"], np.unwrap(self.truth["yaw_rad"]))

    def speed_at(self, t: Array) -> Array:
        """Return the true speed in m/s, from the distance covered within 0.4 s around each time."""
        moved = [
            np.interp(t + 0.2, self.truth["t_s"], self.truth[c]) - np.interp(t - 0.2, self.truth["t_s"], self.truth[c])
            for c in "xy"
        ]
        return np.hypot(*moved) / 0.4


def read_columns(path: Path) -> dict[str, Array]:
    """Read a gzipped CSV file of numbers into columns by name."""
    with gzip.open(path, "rt") as lines:
        names = lines.readline().strip().split(",")
        table = np.loadtxt(lines, delimiter=",")
    return dict(zip(names, table.T, strict=True))


def recording(name: str) -> Recording:
    """Read the IMU samples and the ground truth of a recording. Skip the test where it is missing."""
    folder = recording_or_skip(name)
    columns = read_columns(folder / "imu.csv.gz")
    nothing = np.full(len(columns["t_s"]), np.nan)
    names = ["t_s", "ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz"]
    return Recording(np.stack([columns.get(c, nothing) for c in names], 1), read_columns(folder / "truth.csv.gz"))
