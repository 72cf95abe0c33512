"""Whether something beside the field of the place disturbs the magnetometer: a magnet, a steel door, a motor.

A disturbance is an innovation far beyond r and the uncertainty of the state, in the mean of the three components: the
gyroscope knows the heading. While the hard iron is unknown that does not find a magnet, which is iron like any other,
only sudden. So the change since the last undisturbed sample is looked at, too, in which the iron cancels:

    m - m0 = (R - R0)^T f + v - v0.

After a sudden change only a sample that fits the one before it is undisturbed, whatever an unknown field may explain.
A disturbed sample is not used: the heading is then the gyroscope's, and its variance grows. A disturbance that lasts is
taken for a new field.
"""

import math

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.field import Magnetometer, innovation, predicted_variance

GATE = 5.0  # 15 for three axes: 1 in 500 by chance
STRAIN_TAU = 1.0  # s
GIVE_UP = 30.0  # s of disturbance that make a new field
CHANGE_TAU = 4.0  # s, in which the distortion by the place becomes another one
LEAST_CHANGE, MOST_CHANGE = 0.5, 2.0  # of r^2, variance of its change
LATEST = 1e-9  # s: there is a last sample, and it is the newest


@njit(cache=True, nogil=True)
def mean_nis(g: Magnetometer, R: Array, m: Array) -> float:
    """Return the mean over the axes of squared innovation over variance, without the inflation for correlation."""
    total = 0.0
    for axis in range(3):
        e = innovation(g, R, m, axis)
        total += e * e / (predicted_variance(g, R, axis) + g.noise[axis])
    return total / 3.0


@njit(cache=True, nogil=True)
def strain_of_change(g: Magnetometer, R: Array, m: Array) -> float:
    """Return the mean over the axes of the squared change since the last undisturbed sample over its variance."""
    if g.since_last == 0.0:
        return 0.0
    share = LEAST_CHANGE + (MOST_CHANGE - LEAST_CHANGE) * min(1.0, g.since_last / CHANGE_TAU)
    P, f, total = g.P, g.x, 0.0
    for axis in range(3):
        x, y, z = R[0, axis] - g.last_R[0, axis], R[1, axis] - g.last_R[1, axis], R[2, axis] - g.last_R[2, axis]
        e = m[axis] - g.last_m[axis] - x * f[0] - y * f[1] - z * f[2]
        of_field = x * (x * P[0, 0] + 2.0 * (y * P[0, 1] + z * P[0, 2])) + y * (y * P[1, 1] + 2.0 * z * P[1, 2])
        of_field += z * z * P[2, 2]
        if g.changed == 1:
            of_field = min(of_field, g.noise[axis])
        total += e * e / (of_field + share * g.noise[axis])
    return total / 3.0


@njit(cache=True, nogil=True)
def is_disturbed(g: Magnetometer, R: Array, m: Array, dt: float) -> bool:
    """Return whether a mean over dt, s, is disturbed. A long disturbance makes field and hard iron unknown again."""
    g.since_last += dt if g.since_last > 0.0 else 0.0
    change = strain_of_change(g, R, m)
    if change > GATE:
        g.changed = 1
    g.nis = max(mean_nis(g, R, m), change, g.nis * math.exp(-dt / STRAIN_TAU))
    if g.nis <= GATE:
        g.last_m[:] = m
        g.last_R[:] = R
        g.since_last = LATEST
        g.disturbed = 0.0
        g.changed = 0
        return False
    g.disturbed += dt
    if g.disturbed > GIVE_UP:
        for i in range(6):
            g.P[i, i] += g.unit * g.unit
        g.nis = g.disturbed = g.since_last = 0.0
        g.changed = 0
    return True
