"""Our attitude filter against an independent implementation of the same article: AQUA of the package ahrs.

AQUA returns body_from_world, where the x axis of the world points to magnetic north and z up. Our filter returns
world_from_body in ENU. AQUA integrates the gyroscope to first order (equation 42) and estimates no bias, while our
integration is exact. With small time steps the two agree.
"""

import math

import numpy as np
import pytest
from ahrs.filters import AQUA

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.paper import attitude
from dropanchor_service.estimation.paper.attitude import AttitudeFilter, AttitudeParameters, Quaternion

DT = 0.01
GAIN = 0.02
EAST_FROM_NORTH = attitude.about_up(math.pi / 2)  # turns (north, west, up) into (east, north, up)


def motion(n: int, spin: float) -> tuple[Array, Array, Array]:
    """Return acc, gyro and mag, each (n, 3), of a body that sways while it turns about the vertical at `spin` rad/s."""
    rng = np.random.default_rng(11)
    q: Quaternion = attitude.IDENTITY
    acc, gyro, mag = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    for i in range(n):
        gyro[i] = (0.4 * math.sin(0.011 * i), 0.3 * math.cos(0.017 * i), spin)
        q = attitude.multiply(q, attitude.rotation_by(tuple(gyro[i] * DT)))
        inverse = (q[0], -q[1], -q[2], -q[3])
        acc[i] = attitude.rotate(inverse, (0.0, 0.0, 9.80665))
        mag[i] = attitude.rotate(inverse, (0.0, 20.0, -44.0))
    return acc + rng.normal(0, 0.1, (n, 3)), gyro + rng.normal(0, 0.02, (n, 3)), mag + rng.normal(0, 0.5, (n, 3))


def enu_from_body(q: Array) -> Quaternion:
    """Convert an attitude of AQUA to ours."""
    w, x, y, z = q.tolist()
    return attitude.multiply(EAST_FROM_NORTH, (w, -x, -y, -z))


@pytest.mark.parametrize("spin", [0.5, -0.9], ids=["left", "right"])
def test_the_9_axis_attitude_agrees_with_ahrs_over_many_turns(spin: float) -> None:
    acc, gyro, mag = motion(4000, spin)
    theirs = AQUA(frequency=1 / DT, alpha=GAIN, beta=GAIN)
    q = theirs.estimate(acc[0], mag[0])
    ours = AttitudeFilter(AttitudeParameters(tilt_time=DT / GAIN, yaw_time=DT / GAIN, bias_time=math.inf))
    ours.step(0.0, tuple(acc[0]), tuple(gyro[0]), tuple(mag[0]))
    apart = [_angle(ours, q)]
    for a, g, m in zip(acc[1:], gyro[1:], mag[1:], strict=True):
        q = theirs.updateMARG(q, g, a, m, DT)
        ours.step(DT, tuple(a), tuple(g), tuple(m))
        apart.append(_angle(ours, q))
    assert max(apart) < 1e-3


def test_the_6_axis_attitude_agrees_with_ahrs_across_pi() -> None:
    acc, gyro, _ = motion(2000, 0.8)
    theirs = AQUA(frequency=1 / DT, alpha=GAIN)
    ours = AttitudeFilter(AttitudeParameters(tilt_time=DT / GAIN, bias_time=math.inf))
    field = (math.nan,) * 3
    ours.step(0.0, tuple(acc[0]), tuple(gyro[0]), field)
    assert ours.q is not None
    w, x, y, z = attitude.multiply((EAST_FROM_NORTH[0], 0, 0, -EAST_FROM_NORTH[3]), ours.q)
    q = np.array([w, -x, -y, -z])
    for a, g in zip(acc[1:], gyro[1:], strict=True):
        q = theirs.updateIMU(q, g, a, DT)
        ours.step(DT, tuple(a), tuple(g), field)
        assert _angle(ours, q) < 1e-3


def _angle(ours: AttitudeFilter, theirs: Array) -> float:
    """Return the angle between the two attitudes in rad."""
    assert ours.q is not None
    w, x, y, z = enu_from_body(theirs)
    dw, dx, dy, dz = attitude.multiply((w, -x, -y, -z), ours.q)
    return 2 * math.atan2(math.hypot(dx, dy, dz), abs(dw))
