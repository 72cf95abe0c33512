"""The compiled attitude filter against AQUA of the package ahrs."""

import math
from typing import Any

import ahrs
import numpy as np
from numpy.typing import NDArray

from dropanchor_service.estimation.fleet.frontend.attitude import (
    yaw_of,
)
from support.fleet_attitude import angle_between, attitude_of, rotations, wxyz
from support.imu import synthesise, turning, wrapped

Array = NDArray[Any]


def test_ahrs_aqua_agrees_on_tilt_and_yaw_increments() -> None:
    m = synthesise(np.arange(0, 40, 0.01), turning)
    start = wxyz(m.attitude[0])
    filtered = ahrs.filters.AQUA(gyr=m.gyro, acc=m.acc, frequency=100.0, q0=start * [1, -1, -1, -1])
    theirs = rotations(filtered.Q * [1, -1, -1, -1])  # ahrs turns world into body
    q, _ = attitude_of(m, start)
    assert angle_between(q, theirs).max() < math.radians(1.5)
    assert abs(wrapped(m.yaw - np.array([yaw_of(v) for v in q]))).max() < math.radians(0.1)
