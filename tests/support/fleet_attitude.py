"""The compiled attitude filter on the samples of a motion."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dropanchor_service.estimation.fleet.frontend.attitude import (
    ATTITUDE,
    TILT_SD,
    correct_tilt,
    predict_attitude,
)
from support.imu import G0, Motion

Array = NDArray[Any]


def follow(a: Any, t: Array, acc: Array, gyro: Array, rest_until: float, q: Array) -> None:
    for k in range(len(t)):
        dt = t[k] - t[k - 1] if k else 0.0
        predict_attitude(a, dt, gyro[k], t[k] < rest_until)
        correct_tilt(a, dt, acc[k, 0], acc[k, 1], acc[k, 2], t[k] < rest_until, 0.0)
        q[k] = a["q"]


def attitude_of(m: Motion, start: Array, rest_until: float = -1.0, bias_std: float = 0.0) -> tuple[Array, Array]:
    """Return the quaternions (n, 4) and the row after the motion.

    start: (w, x, y, z). bias_std: rad/s, how well the bias of the gyroscope is known at first.
    """
    row = np.zeros(1, ATTITUDE)
    row[0]["q"] = start
    row[0]["gyro"] = m.gyro[0]
    row[0]["gravity"] = G0
    row[0]["tilt_cov"] = TILT_SD**2, 0.0, bias_std**2
    q = np.empty((len(m.t), 4))
    follow(row[0], m.t, m.acc, m.gyro, rest_until, q)
    return q, row[0]


def wxyz(r: Rotation) -> Array:
    return np.roll(r.as_quat(), 1, axis=-1)


def rotations(q: Array) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


def angle_between(q: Array, truth: Rotation) -> Array:
    """Return the angles in rad, (n,)."""
    return (rotations(q).inv() * truth).magnitude()  # type: ignore[no-any-return]
