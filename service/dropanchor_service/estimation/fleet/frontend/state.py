"""What the front-end of one tag knows, and how it begins."""

import math
from typing import Any, TypeAlias

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.attitude import ATTITUDE, LEVEL_BIAS_SD, TILT_SD, level_attitude
from dropanchor_service.estimation.fleet.frontend.carrying import AUTO, CARRYING, start_carrying
from dropanchor_service.estimation.fleet.frontend.field import MAGNETOMETER
from dropanchor_service.estimation.fleet.frontend.large_bias import LARGE_BIAS, start_large_bias
from dropanchor_service.estimation.fleet.frontend.preintegration import G0, PREINTEGRATION
from dropanchor_service.estimation.fleet.frontend.standstill import STANDSTILL, start_standstill

FRONTEND = np.dtype(
    [
        ("attitude", ATTITUDE),
        ("standstill", STANDSTILL),
        ("large_bias", LARGE_BIAS),
        ("magnetometer", MAGNETOMETER),
        ("preintegration", PREINTEGRATION),
        ("carrying", CARRYING),
        ("hard_iron", "f8"),  # prior sd of the magnetometer's hard iron, in units of the field
        ("declination", "f8"),  # rad, of magnetic north, positive east
        ("t_imu", "i8"),  # ns, of the last IMU sample
        ("t_node", "i8"),  # ns, end of the last node
        ("bias_end", "f8"),  # rad/s, the gyroscope's bias about the vertical when the last node ended
        ("running", "u1"),  # 0: no sample yet
        ("new", "u1"),  # 1: there was none before it was configured
        ("absolute", "u1"),  # 1: the heading is referred to north
        ("turned", "f8"),  # rad since start, net
        ("drift_var", "f8"),  # rad^2, of yaw since start
        ("drift_cov", "f8"),  # rad^2/s, of yaw with the gyroscope's bias
        ("last", "f8", 6),  # acc and gyro of the last sample
        ("frozen_s", "f8"),  # s for which it has been the same
    ],
    align=True,
)
Frontend: TypeAlias = Any  # a record of FRONTEND


@njit(cache=True, nogil=True)
def start_frontend(f: Frontend, hard_iron: float, declination: float, motion: int = AUTO) -> None:
    """Reset the front-end.

    hard_iron: prior sd of the magnetometer's offset in units of the field; 1 for a bare one, 0.05 for a calibrated one.
    declination: rad, true minus magnetic north, positive east. motion: the setting.
    """
    f.new = 1 - f.running
    f.running = f.t_node = f.absolute = 0
    f.carrying.motion, f.hard_iron, f.declination = motion, hard_iron, declination
    f.attitude.tilt_cov[:] = TILT_SD * TILT_SD, 0.0, LEVEL_BIAS_SD * LEVEL_BIAS_SD
    f.attitude.age = f.turned = f.drift_var = f.drift_cov = f.magnetometer.unit = 0.0


@njit(cache=True, nogil=True)
def start_at(f: Frontend, t_ns: int, acc: Array, gyro: Array) -> None:
    """Level the attitude with the first sample and begin the first node there."""
    a, p, s = f.attitude, f.preintegration, f.standstill
    a.q[:] = 1.0, 0.0, 0.0, 0.0
    a.gyro[:] = gyro
    a.bias[:] = 0.0
    f.bias_end = 0.0
    a.gravity = G0
    start_standstill(s, acc, gyro)
    start_large_bias(f.large_bias, f.new == 1)
    p.V[:] = p.a[:] = p.V_end[:] = 0.0
    p.shaking[:] = 0.0
    p.acc_var = p.yaw_rate = p.yaw_end = p.gap_s = p.extrapolated_s = p.no_acc_s = p.tilt_gain = 0.0
    start_carrying(f.carrying, a.gravity, f.carrying.motion)
    if math.isfinite(acc[0] + acc[1] + acc[2]):
        level_attitude(a.q, acc[0], acc[1], acc[2])
    f.t_imu = t_ns
    if f.t_node == 0:
        f.t_node = t_ns
    f.running = 1
