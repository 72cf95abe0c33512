"""Speed from ranges alone, on straight lines (the paper's section III-B and lines 1-8 of Algorithm 1).

On a straight line at constant speed v, with s the distance along the line from the point nearest the anchor and
D the distance of that point from the anchor,

    r(t)² = D² + (s0 + v t)²        so the second divided difference of r² is v².

A difference in height between tag and anchor only adds to D², so slant ranges need no correction.
"""

import math
from collections import deque
from dataclasses import dataclass


@dataclass(frozen=True)
class KeyRange:
    """A key range pair: the range r, m, at the time t, s."""

    t: float
    r: float


def speed_squared(k0: KeyRange, k1: KeyRange, k2: KeyRange) -> float:
    """Return v² in m²/s² from three ranges at distinct times, negative if noise outweighs the curvature of r².

        v² = [ (r2² - r1²) - (dt2/dt1) (r1² - r0²) ] / (dt1 dt2 + dt2²)      dt1 = t1 - t0,  dt2 = t2 - t1

    The paper prints dt1 dt2 + dt1², which is correct only for equal intervals. From r_i² = D² + (s + v t_i)², t_1 = 0:
    r2² - r1² = 2 s v dt2 + v² dt2² and r1² - r0² = 2 s v dt1 - v² dt1²; eliminating s leaves v² (dt2² + dt1 dt2).
    """
    dt1, dt2 = k1.t - k0.t, k2.t - k1.t
    rise1, rise2 = k1.r * k1.r - k0.r * k0.r, k2.r * k2.r - k1.r * k1.r
    return (rise2 - dt2 / dt1 * rise1) / (dt1 * dt2 + dt2 * dt2)


class SpeedEstimator:
    """The VelEstimator of Algorithm 1: the mean speed of a window that grows with the range, from key range pairs.

    threshold: TH_distance, m, by which the smoothed range must differ from the last key range.
    spacing: count of key pairs from one of the three points to the next (the paper: 1, consecutive).
    window_base, window_ratio: windowLen = base + ratio · range, in speeds (the paper: base 0).
    If v² < 0 there is no speed. The released code takes |v²|, which turns noise into speed.
    """

    def __init__(self, threshold: float, spacing: int, window_base: float, window_ratio: float) -> None:
        self._threshold = threshold
        self._window_base = window_base
        self._window_ratio = window_ratio
        self._pairs: deque[KeyRange] = deque(maxlen=2 * spacing + 1)
        self._speeds: deque[float] = deque()
        self._spacing = spacing

    def end_of_line(self) -> None:
        """Forget the pairs after a turn: they are not on the new line."""
        self._pairs.clear()

    def step(self, t: float, r: float) -> float | None:
        """Add the smoothed range r, m, at t, s. Return the mean speed, m/s, if it makes a key pair that gives one."""
        if self._pairs and not (abs(r - self._pairs[-1].r) > self._threshold and t > self._pairs[-1].t):
            return None
        self._pairs.append(KeyRange(t, r))
        if len(self._pairs) < 2 * self._spacing + 1:
            return None
        v2 = speed_squared(self._pairs[0], self._pairs[self._spacing], self._pairs[-1])
        if not v2 > 0:
            return None
        return self._mean(math.sqrt(v2), r)

    def _mean(self, v: float, r: float) -> float:
        self._speeds.append(v)
        length = max(1, round(self._window_base + self._window_ratio * r))
        while len(self._speeds) > length:
            self._speeds.popleft()
        return sum(self._speeds) / len(self._speeds)
