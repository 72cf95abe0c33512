"""Standstill: whether the tag is at rest, and what the gyroscope reads then.

A tag is quiet while the exponentially weighted standard deviations of accelerometer and gyroscope and the mean rotation
are small. It is at rest when it has been quiet for HOLD seconds. Where an accelerometer's own noise is as large as the
limit, its variance falls below it for tenths of a second, in motion as well: time near the limit counts a third, and no
rest begins before the variance is far below the limit.
The gyroscope's bias is learned in blocks of rest, and only from blocks that another block of rest followed, so that
neither the end nor the start of a motion counts. The first rest after switch-on has no motion before it: it is used
sooner, in shorter blocks. Many tags rest for no more than a second.
Bias: scalar Kalman filter per axis, P += Q dt, block mean of rate with variance R, from the noise that it shows.

Hard braking leaves a hundred times the limit in a variance and keeps a stop from being seen for a second. So the
detector has a mean of its own, which a jump starts anew, and a variance that counts no sample for more than `CLIP`.
"""

import math
from typing import Any, TypeAlias

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit

STANDSTILL = np.dtype(
    [
        ("mean", "f8", 6),  # of acc and gyro, exponentially weighted
        ("deviation", "f8", 3),  # m/s^2, of the last acc from its mean; its squares average to acc_var
        ("acc_var", "f8"),  # sum over the axes, (m/s^2)^2
        ("still", "f8", 3),  # m/s^2, mean of acc since its last jump
        ("still_var", "f8"),  # (m/s^2)^2, about that mean, bounded
        ("gyro_bias_var", "f8"),  # sum over the axes, (rad/s)^2
        ("seen", "f8"),  # s of samples seen, up to a limit
        ("quiet", "f8"),  # s of quiet
        ("block", "f8", 4),  # time and integrated rate of the block of rest under way
        ("last", "f8", 4),  # of the block before, not yet used
        ("bias_var", "f8"),  # (rad/s)^2
        ("moved", "u1"),  # 1: it has not been quiet all the time since the first sample
    ]
)
Standstill: TypeAlias = Any  # a record of STANDSTILL

TAU = 0.12  # s
ACC_SD = 0.08  # m/s^2, root of the sum over three axes: 0.045 per axis
JUMP = 0.5  # m/s^2, deviation of an axis that no tag at rest shows
CLIP = 4.0  # times the limit's variance
CLEAR, DOUBT = 0.8, 3.0  # share of the limit's variance above which quiet counts only a third
GYRO_SD = 0.05  # rad/s, likewise
RATE = 0.03  # rad/s, of the bias that the mean rotation at rest may show: a hand turns as slowly
RATE_KNOWN = 0.02  # rad/s, beside the bias
SURE = 0.55  # share of the limit's variance above which no rest begins
HOLD = 0.2  # s of quiet that make rest
CONFIRM = 0.5  # s of quiet before the bias is learned
BLOCK = 0.5  # s
FIRST_CONFIRM, FIRST_BLOCK = 0.2, 0.15  # s, of the rest at switch-on
BIAS_SD = 0.02  # rad/s, at switch-on: data sheets say 0.5 to 3 deg/s of an axis
BIAS_WALK = 4e-8  # (rad/s)^2/s: 0.04 deg/s in 10 s, as while it warms by some degrees
BIAS_NOISE = 4e-6  # (rad/s)^2 s: of a block mean, times its length, at most
LEAST_NOISE = 4e-7  # (rad/s)^2 s: and at least
WHITE = 3.0  # times the variance of white noise as large as what is seen


@njit(cache=True, nogil=True)
def start_standstill(s: Standstill, acc: Array, gyro: Array) -> None:
    """Start with one sample."""
    for i in range(3):
        s.mean[i] = acc[i] if math.isfinite(acc[i]) else 0.0
        s.mean[3 + i] = gyro[i]
    s.still[:] = s.mean[:3]
    s.deviation[:] = 0.0
    s.block[:] = s.last[:] = 0.0
    s.still_var = s.acc_var = s.gyro_bias_var = s.seen = s.quiet = 0.0
    s.bias_var = BIAS_SD * BIAS_SD
    s.moved = 0


@njit(cache=True, nogil=True)
def update_channel(s: Standstill, k: float, i: int, value: float) -> float:
    """Update the exponentially weighted mean of channel i. Return the deviation whose square is to be averaged."""
    d = value - s.mean[i]
    s.mean[i] += k * d
    return math.sqrt(1.0 - k) * d  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def update_still(s: Standstill, k: float, acc: Array) -> None:
    """Update `still`, the mean since the last jump, and `still_var` about it. acc: (3,), m/s^2; k: gain, 0 to 1."""
    square = 0.0
    for i in range(3):
        d = acc[i] - s.still[i]
        s.still[i] += d if abs(d) > JUMP else k * d
        square += (1.0 - k) * d * d
    s.still_var += k * (min(square, CLIP * ACC_SD * ACC_SD) - s.still_var)


@njit(cache=True, nogil=True)
def is_steady(s: Standstill) -> bool:
    """Return whether the tag neither shakes nor changes its rates. It may turn evenly."""
    return s.still_var < ACC_SD * ACC_SD and s.gyro_bias_var < GYRO_SD * GYRO_SD  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def update_standstill_detector(s: Standstill, dt: float, acc: Array, gyro: Array, bias: Array) -> None:
    """Update with one IMU sample. Then `s.quiet` is the time, s, for which the tag has been quiet."""
    if dt == 0.0:
        return
    k = dt / (min(s.seen, TAU) + dt)
    s.seen += dt
    va = vg = 0.0
    for i in range(3):
        s.deviation[i] = update_channel(s, k, i, acc[i])
        va += s.deviation[i] ** 2
        vg += update_channel(s, k, 3 + i, gyro[i]) ** 2
    update_still(s, k, acc)
    s.acc_var += k * (va - s.acc_var)
    s.gyro_bias_var += k * (vg - s.gyro_bias_var)
    x, y, z = s.mean[3] - bias[0], s.mean[4] - bias[1], s.mean[5] - bias[2]
    limit = RATE_KNOWN + min(RATE, 3.0 * math.sqrt(s.bias_var))
    calm = is_steady(s) and x * x + y * y + z * z < limit * limit
    share = s.still_var / (ACC_SD * ACC_SD)
    quiet = s.quiet + (dt if share < CLEAR else dt / DOUBT) if calm and s.seen > TAU else 0.0
    if not s.quiet <= HOLD < quiet or share < SURE:  # else this sample would begin a rest near the limit
        s.quiet = quiet
    if s.quiet == 0.0 and s.seen > TAU:
        s.moved = 1


@njit(cache=True, nogil=True)
def at_rest(s: Standstill) -> bool:
    """Return whether the tag is at rest, for a zero-velocity update."""
    return s.quiet > HOLD  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def block_noise(s: Standstill, dt: float) -> float:
    """Return the variance of the mean rate of a block of rest times its length, (rad/s)^2 s."""
    return min(BIAS_NOISE, LEAST_NOISE + WHITE * s.gyro_bias_var / 3.0 * dt)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def update_gyro_bias(s: Standstill, dt: float, gyro: Array, bias: Array) -> None:
    """Update `bias` from confirmed rest. Call it with every sample."""
    s.bias_var = min(s.bias_var + BIAS_WALK * dt, BIAS_SD * BIAS_SD)
    if s.quiet < (CONFIRM if s.moved == 1 else FIRST_CONFIRM):
        s.block[0] = 0.0
        s.last[0] = 0.0
        return
    if s.block[0] == 0.0:
        s.block[:] = 0.0
    s.block[0] += dt
    for i in range(3):
        s.block[i + 1] += dt * gyro[i]
    if s.block[0] < (BLOCK if s.moved == 1 else FIRST_BLOCK):
        return
    if s.last[0] > 0.0:
        gain = s.bias_var / (s.bias_var + block_noise(s, dt) / s.last[0])
        s.bias_var *= 1.0 - gain
        for i in range(3):
            bias[i] += gain * (s.last[i + 1] / s.last[0] - bias[i])
    s.last[:] = s.block
    s.block[0] = 0.0
