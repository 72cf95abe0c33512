"""Steps of a walking person, from the size of the acceleration, and the speed and the direction that they give.

x is |a|, high-passed (TAU_HIGH) and low-passed (two poles at TAU_LOW). A step is a peak of x from which x has fallen by
`reversal`, and that came at least MIN_INTERVAL after the one before. With the height W of a peak above the
lowest point before it and the time T since the last peak, a step has (Kim 2004)

    length = STEP_LENGTH W^(1/3),   speed = sum of lengths / sum of T, both with forgetting.

A person walks when steps of at least MIN_SWING came at similar intervals, and W adds up to WALK over them: three of a
phone that swings in the hand, four of one that is held still. No recorded robot, drone or cart reached that
(`tests/service/estimation/fleet/test_recorded_honesty.py`).

With every step a walker is pushed forward while the upward acceleration grows. The horizontal acceleration a (level
frame) is therefore correlated with the rate of change of the upward acceleration, and points along the course:

    g = sum a dv/dt,    coherence = |g| / sqrt(sum |a|^2  sum (dv/dt)^2)

All three axes pass the same filter (0.8 to 3 Hz) first. A device in one hand also swings sideways in this rhythm, which
turns g by a constant angle.
"""

import math
from typing import Any, Final, TypeAlias

import numpy as np

from dropanchor_service.estimation.fleet.compiled import njit

GAIT: Final = np.dtype(
    [
        ("slow", "f8"),  # m/s^2, slow mean of |a|
        ("low", "f8", 2),  # m/s^2, the two poles
        ("seen_s", "f8"),
        ("falling", "u1"),  # 1: x has turned back from its last peak
        ("peak", "f8"),  # m/s^2, highest x since the last trough
        ("trough", "f8"),  # m/s^2, lowest x since the last peak
        ("swing", "f8"),  # m/s^2, mean W of the last steps
        ("since_peak_s", "f8"),  # since the highest x, which may become a step
        ("since_step_s", "f8"),  # since the last step's peak
        ("interval", "f8"),  # s, mean of the last steps
        ("regular", "i4"),  # mm/s^2, sum of W over the steps in a row at similar intervals, each FULL_SWING at most
        ("length_sum", "f8"),  # m, with forgetting
        ("time_sum", "f8"),  # s
        ("walked", "f8"),  # m since the person last stood
    ]
)
Gait: TypeAlias = Any  # a record of GAIT

STRIDE: Final = np.dtype(
    [
        ("slow", "f8", 3),  # m/s^2, slow mean of the acceleration east, north, up in the level frame
        ("low", "f8", (2, 3)),  # m/s^2, two poles of the rest
        ("sums", "f8", 4),  # of a dv/dt (2), |a|^2 and (dv/dt)^2, with forgetting
    ]
)
Stride: TypeAlias = Any  # a record of STRIDE

TAU_HIGH = 1.5  # s
TAU_LOW = 0.04  # s, of each of two poles: 2.6 Hz together
MIN_INTERVAL, MAX_INTERVAL = 0.28, 1.2  # s
REVERSAL, REVERSAL_SHARE = 0.6, 0.35  # m/s^2, and of the mean swing
MIN_SWING, FULL_SWING = 1.5, 2.5  # m/s^2, of a step that counts as walking, and the most that one counts for
SIMILAR = 0.35  # relative deviation of an interval from the mean
MM_PER_M = 1000.0  # `regular` is an integer
WALK = 6_000  # mm/s^2, of `regular`, that make a walk
MOST_REGULAR = 100 * WALK  # a walk of days must not overflow
FORGET = 1.5  # s of steps in the mean speed
STEP_LENGTH = 0.362  # m per (m/s^2)^(1/3)
FIRST_STEP = 0.5  # of its length: the way of somebody who stood until its peak
STRIDE_TAU_HIGH = 0.2  # s: 0.8 Hz
STRIDE_FORGET = 2.0  # s


@njit(cache=True, nogil=True)
def start_gait(g: Gait, size: float) -> None:
    """Start with the size of one acceleration, m/s^2."""
    g.slow, g.since_step_s = size, MAX_INTERVAL
    g.falling, g.regular = 1, 0
    g.low[:] = 0.0
    g.seen_s = g.peak = g.trough = g.swing = g.since_peak_s = g.interval = 0.0
    g.length_sum = g.time_sum = g.walked = 0.0


@njit(cache=True, nogil=True)
def add_step_sample(g: Gait, dt: float, size: float) -> bool:
    """Take the size of one acceleration, m/s^2. Return whether it completes a step."""
    g.seen_s += dt
    g.slow += dt / (min(g.seen_s, TAU_HIGH) + dt) * (size - g.slow)
    k = dt / (TAU_LOW + dt)
    g.low[0] += k * (size - g.slow - g.low[0])
    g.low[1] += k * (g.low[0] - g.low[1])
    x = g.low[1]
    g.since_step_s += dt
    g.since_peak_s += dt
    if g.since_step_s > MAX_INTERVAL:
        g.regular, g.swing = 0, 0.0  # else large steps, or a device that was waved, would hide small ones
        g.length_sum = g.time_sum = g.walked = 0.0
    reversal = max(REVERSAL, REVERSAL_SHARE * g.swing)
    if g.falling == 0:
        if x > g.peak:
            g.peak, g.since_peak_s = x, 0.0
        elif x < g.peak - reversal:
            g.falling = 1
            step = _end_step(g)
            g.trough = x
            return step
    else:
        if x < g.trough:
            g.trough = x
        elif x > g.trough + reversal:
            g.falling = 0
            g.peak, g.since_peak_s = x, 0.0
    return False


@njit(cache=True, nogil=True)
def _end_step(g: Gait) -> bool:
    """Count the highest point as a step, unless it came too soon after the one before."""
    interval = g.since_step_s - g.since_peak_s
    if interval < MIN_INTERVAL:
        return False
    swing = g.peak - g.trough
    if interval > MAX_INTERVAL:
        g.regular, g.interval, g.swing = 0, 0.0, swing
        g.walked = FIRST_STEP * _length(swing)
    else:
        first = g.interval == 0.0
        similar = swing > MIN_SWING and (first or abs(interval - g.interval) < SIMILAR * g.interval)
        g.regular = min(g.regular + int(MM_PER_M * min(swing, FULL_SWING)), MOST_REGULAR) if similar else 0
        g.interval = interval if first else g.interval + 0.3 * (interval - g.interval)
        g.swing += 0.3 * (swing - g.swing)
        kept = math.exp(-interval / FORGET)
        length = _length(swing)
        g.walked += length
        g.length_sum = g.length_sum * kept + length
        g.time_sum = g.time_sum * kept + interval
    g.since_step_s = g.since_peak_s
    return True


@njit(cache=True, nogil=True)
def _length(swing: float) -> float:
    """Return the length of a step, m, from its W, m/s^2."""
    return float(STEP_LENGTH * max(swing, 0.0) ** (1.0 / 3.0))


@njit(cache=True, nogil=True)
def step_speed(g: Gait) -> float:
    """Return the speed of the last steps, m/s."""
    return g.length_sum / g.time_sum if g.time_sum > 0.0 else 0.0


@njit(cache=True, nogil=True)
def add_stride_sample(d: Stride, dt: float, east: float, north: float, up: float) -> None:
    """Take one acceleration, m/s^2, in the level frame, without gravity."""
    high, k, kept = dt / (STRIDE_TAU_HIGH + dt), dt / (TAU_LOW + dt), 1.0 - dt / STRIDE_FORGET
    for i, value in enumerate((east, north, up)):
        d.slow[i] += high * (value - d.slow[i])
        d.low[0, i] += k * (value - d.slow[i] - d.low[0, i])
        d.low[1, i] += k * (d.low[0, i] - d.low[1, i])
    x, y = d.low[1, 0], d.low[1, 1]
    rate = (d.low[0, 2] - d.low[1, 2]) / TAU_LOW
    d.sums[0] = kept * d.sums[0] + dt * x * rate
    d.sums[1] = kept * d.sums[1] + dt * y * rate
    d.sums[2] = kept * d.sums[2] + dt * (x * x + y * y)
    d.sums[3] = kept * d.sums[3] + dt * rate * rate


@njit(cache=True, nogil=True)
def stride_direction(d: Stride) -> tuple[float, float]:
    """Return (azimuth in the level frame, rad; coherence, 0 to 1)."""
    scale = math.sqrt(d.sums[2] * d.sums[3])
    if scale <= 0.0:
        return 0.0, 0.0
    return math.atan2(d.sums[1], d.sums[0]), math.hypot(d.sums[0], d.sums[1]) / scale
