"""Where magnetic north lies in the gyroscope's level frame: what the magnetometer's samples tell its field.

The distortion of the field by the place is correlated along the path (a few seconds at walking speed) and
constant at rest. Its variance is therefore inflated by 2 tau / dt, and a resting tag teaches nothing after its first
seconds. Its size r is learned per body axis, as the running mean square of the residuals of undisturbed samples. On
every lap the place distorts the field in the same way: the variance of north gets a share of r^2 that no averaging
lowers.

Something beside the field of the place may disturb it: a magnet, a steel door, a motor.
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
from dropanchor_service.estimation.fleet.angles import wrap
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.attitude import yaw_of
from dropanchor_service.estimation.fleet.frontend.field import (
    NOISE_PRIOR,
    Magnetometer,
    fuse_axis,
    innovation,
    level_noise,
    predict_field,
    predicted_variance,
    start_magnetometer,
)

PERIOD = 0.0999  # s between updates; samples between are averaged
CORRELATION = 4.0  # s
NOISE_FLOOR = 0.01  # of the unit: least r
NOISE_TAU = 20.0  # s
REST_LEARNING = 3.0  # s
SYSTEMATIC = 0.5  # of r, over the horizontal field: error of north that lasts
GATE = 5.0  # 15 for three axes: 1 in 500 by chance
STRAIN_TAU = 1.0  # s
GIVE_UP = 30.0  # s of disturbance that make a new field
CHANGE_TAU = 4.0  # s, in which the distortion by the place becomes another one
LEAST_CHANGE, MOST_CHANGE = 0.5, 2.0  # of r^2, variance of its change
LATEST = 1e-9  # s: there is a last sample, and it is the newest


@njit(cache=True, nogil=True)
def update_noise(g: Magnetometer, R: Array, m: Array, dt: float) -> None:
    """Update r^2 with the squared residuals."""
    g.age = min(g.age + dt, NOISE_TAU)
    floor = NOISE_FLOOR * g.unit
    for axis in range(3):
        e = innovation(g, R, m, axis)
        g.noise[axis] += dt / g.age * (max(e * e, floor * floor) - g.noise[axis])


@njit(cache=True, nogil=True)
def add_to_sums(g: Magnetometer, q: Array, mx: float, my: float, mz: float) -> None:
    """Add one sample to the sums. m = R^T f + h is linear in R, so the means over a short time satisfy it, too."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    S = g.sum_R
    S[0, 0] += 1.0 - 2.0 * (y * y + z * z)
    S[0, 1] += 2.0 * (x * y - w * z)
    S[0, 2] += 2.0 * (x * z + w * y)
    S[1, 0] += 2.0 * (x * y + w * z)
    S[1, 1] += 1.0 - 2.0 * (x * x + z * z)
    S[1, 2] += 2.0 * (y * z - w * x)
    S[2, 0] += 2.0 * (x * z - w * y)
    S[2, 1] += 2.0 * (y * z + w * x)
    S[2, 2] += 1.0 - 2.0 * (x * x + y * y)
    g.sum_m[0] += mx
    g.sum_m[1] += my
    g.sum_m[2] += mz
    g.count += 1.0


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


@njit(cache=True, nogil=True)
def fuse(g: Magnetometer, dt: float, rest: bool) -> None:
    """Update with the mean of the samples since the last update, dt s ago. The sums become these means."""
    R, m = g.sum_R, g.sum_m
    for i in range(3):
        m[i] /= g.count
        for j in range(3):
            R[i, j] /= g.count
    if rest and g.age > NOISE_PRIOR + REST_LEARNING:
        return
    if is_disturbed(g, R, m, dt):
        return
    first = g.age == NOISE_PRIOR
    inflation = 1.0 if first else max(1.0, 2.0 * CORRELATION / dt)
    for axis in range(3):
        fuse_axis(g, R, m, axis, inflation)
    update_noise(g, R, m, dt)


@njit(cache=True, nogil=True)
def update_magnetometer(
    g: Magnetometer, dt: float, q: Array, mag: Array, rest: bool, hard_iron: float, bias_var: float
) -> None:
    """Take one IMU sample, after the attitude. `mag` is NaN where there is no sample of the field.

    bias_var: (rad/s)^2, of the gyroscope's bias.
    """
    known = math.isfinite(mag[0] + mag[1] + mag[2])
    if g.unit == 0.0:
        if not known or mag[0] == mag[1] == mag[2] == 0.0:
            return
        start_magnetometer(g, mag[0], mag[1], mag[2], hard_iron, bias_var)
        g.yaw = yaw_of(q)
    g.elapsed += dt
    if known:
        add_to_sums(g, q, mag[0], mag[1], mag[2])
    if g.elapsed < PERIOD or g.count == 0.0:
        return
    yaw = yaw_of(q)
    dyaw = wrap(yaw - g.yaw)
    if not rest:
        predict_field(g, g.elapsed, dyaw)
    fuse(g, g.elapsed, rest)
    g.yaw = yaw
    g.elapsed = g.count = 0.0
    g.sum_m[:] = 0.0
    g.sum_R[:] = 0.0


@njit(cache=True, nogil=True)
def north_of(g: Magnetometer) -> tuple[float, float]:
    """Return the azimuth of magnetic north in the level frame, rad, and its variance, rad^2."""
    x, y = g.x[0], g.x[1]
    n2 = x * x + y * y
    if n2 == 0.0:
        return 0.0, math.inf
    variance = (y * y * g.P[0, 0] - 2.0 * x * y * g.P[0, 1] + x * x * g.P[1, 1]) / (n2 * n2)
    return math.atan2(y, x), variance + SYSTEMATIC * SYSTEMATIC * level_noise(g) / n2
