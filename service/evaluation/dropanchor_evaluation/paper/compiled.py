"""Algorithm 1 as compiled code, for experiments with hundreds of runs. It gives the same numbers as the engine `paper`.

It covers what the simulations need: one anchor at the origin, a known start, measured headings, no IMU. The engine in
`estimation/` is the readable version, and a test compares the two. The report needs the speed: its families alone are
10,400 runs of the paper's filters. This version also offers the vanilla EKF, which the engine does not.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.paper.parameters import PaperParameters

NEAREST = 1e-3  # m, as in the engine


@dataclass(frozen=True)
class Estimate:
    """The estimate after each instant, (n,): x, y, m; theta, rad; v, m/s; cov (n, 2, 2) of x, y. NaN at first."""

    x: Array
    y: Array
    theta: Array
    v: Array
    cov: Array


def algorithm1(
    t: Array,
    heading: Array,
    ranges: Array,
    start: tuple[float, float, float],
    parameters: PaperParameters,
    speed_estimator: bool = True,
) -> Estimate:
    """Run Algorithm 1 or, without the speed estimator, the vanilla EKF of the paper.

    t: (n,) s; heading: (n,) rad; ranges: (n,) m; NaN if there is none. At each instant the heading is used first.
    start: x, y, heading.
    """
    p = parameters
    numbers = np.array(
        [
            *(p.q_position, p.q_heading, p.q_speed, p.q_turn_rate, p.range_std, p.heading_std, p.gate),
            *(p.start_std, p.start_heading_std, p.start_speed_std, p.start_turn_rate_std, p.lost_after),
            *(p.q_smooth, p.r_smooth, p.th_distance, p.th_turn, p.window_base, p.window_ratio, p.blend),
        ]
    )
    out = _run(t, heading, ranges, np.array(start), numbers, p.pair_spacing, speed_estimator)
    return Estimate(out[:, 0], out[:, 1], out[:, 2], out[:, 3], out[:, [4, 5, 5, 6]].reshape(-1, 2, 2))


@njit(cache=True)
def _wrapped(angle: float) -> float:
    wrapped: float = angle - math.tau * np.rint(angle / math.tau)
    return wrapped


@njit(cache=True)
def _predict(x: Array, P: Array, q: Array, dt: float) -> Array:
    """Propagate x in place and return the prior covariance."""
    middle = x[2] + x[4] * dt / 2
    c, s = math.cos(middle) * dt, math.sin(middle) * dt
    F = np.eye(5)
    F[0, 2], F[0, 3], F[0, 4] = -x[3] * s, c, -x[3] * s * dt / 2
    F[1, 2], F[1, 3], F[1, 4] = x[3] * c, s, x[3] * c * dt / 2
    F[2, 4] = dt
    x[0] += x[3] * c
    x[1] += x[3] * s
    x[2] = _wrapped(x[2] + x[4] * dt)
    return F @ P @ F.T + np.diag(q * dt)


@njit(cache=True)
def _update(x: Array, P: Array, y: float, h: Array, R: float) -> Array:
    """Correct x in place and return the posterior covariance, in Joseph form."""
    Ph = P @ h
    K = Ph / (h @ Ph + R)
    x += K * y
    x[2] = _wrapped(x[2])
    A = np.eye(5) - np.outer(K, h)
    return A @ P @ A.T + R * np.outer(K, K)


@njit(cache=True)
def _range_update(x: Array, P: Array, z: float, R: float, gate: float) -> tuple[bool, Array]:
    """Update with a range. Return whether it passed the gate, and the posterior covariance."""
    r = math.sqrt(x[0] ** 2 + x[1] ** 2)
    h = np.zeros(5)
    if r >= NEAREST:
        h[0], h[1] = x[0] / r, x[1] / r
    y = z - r
    if not y * y <= gate * gate * (h @ P @ h + R):
        return False, P
    return True, _update(x, P, y, h, R)


@njit(cache=True)
def _smoothed(smooth: Array, t: float, z: float, q: float, R: float) -> None:
    """Update the range filter in place. smooth: time, range and variance; the time is NaN before the first range."""
    if np.isnan(smooth[0]):
        smooth[0], smooth[1], smooth[2] = t, z, R
    prior = smooth[2] + q * (t - smooth[0])
    gain = prior / (prior + R)
    smooth[0] = t
    smooth[1] += gain * (z - smooth[1])
    smooth[2] = (1 - gain) ** 2 * prior + gain**2 * R


@njit(cache=True)
def _squared_speed(pairs: Array, spacing: int) -> float:
    dt1, dt2 = pairs[spacing, 0] - pairs[0, 0], pairs[-1, 0] - pairs[spacing, 0]
    rise1 = pairs[spacing, 1] ** 2 - pairs[0, 1] ** 2
    rise2 = pairs[-1, 1] ** 2 - pairs[spacing, 1] ** 2
    v2: float = (rise2 - dt2 / dt1 * rise1) / (dt1 * dt2 + dt2 * dt2)
    return v2


@njit(cache=True)
def _window_speed(smooth: Array, pairs: Array, speeds: Array, counts: Array, p: Array, spacing: int) -> float:
    """Run VelEstimator and return the speed, or NaN if there is no new one.

    counts: number of pairs, number of speeds, index of the first speed of the window.
    """
    t, r = smooth[0], smooth[1]
    last = counts[0] - 1
    if counts[0] > 0 and not (abs(r - pairs[last, 1]) > p[14] and t > pairs[last, 0]):
        return math.nan
    if counts[0] == len(pairs):
        pairs[:-1] = pairs[1:].copy()
        counts[0] -= 1
    pairs[counts[0], 0], pairs[counts[0], 1] = t, r
    counts[0] += 1
    if counts[0] < len(pairs):
        return math.nan
    v2 = _squared_speed(pairs, spacing)
    if not v2 > 0:
        return math.nan
    speeds[counts[1]] = math.sqrt(v2)
    counts[1] += 1
    length = max(1, int(np.rint(p[16] + p[17] * r)))
    counts[2] = max(counts[2], counts[1] - length)
    mean: float = speeds[counts[2] : counts[1]].mean()
    return mean


@njit(cache=True)
def _run(t: Array, heading: Array, ranges: Array, start: Array, p: Array, spacing: int, speed_estimator: bool) -> Array:
    q = np.array([p[0], p[0], p[1], p[2], p[3]])
    out = np.full((len(t), 7), np.nan)
    x = np.array([start[0], start[1], start[2], 0.0, 0.0])
    P = np.diag(np.array([p[7], p[7], p[8], p[9], p[10]]) ** 2)
    pairs, speeds, counts = np.empty((2 * spacing + 1, 2)), np.empty(len(t)), np.zeros(3, np.int64)
    smooth = np.full(3, np.nan)
    now = fused = line = np.nan
    for i in range(len(t)):
        if not (np.isnan(now) or np.isnan(heading[i])):
            P = _predict(x, P, q, t[i] - now)
            now = t[i]
            P = _update(x, P, _wrapped(heading[i] - x[2]), np.array([0.0, 0.0, 1.0, 0.0, 0.0]), p[5] ** 2)
        if not np.isnan(ranges[i]):
            if np.isnan(now):
                now = fused = t[i]
            if t[i] - fused > p[11]:
                out[i:] = out[i - 1]  # lost: the engine keeps this estimate from now on
                break
            P = _predict(x, P, q, t[i] - now)
            now = t[i]
            accepted, P = _range_update(x, P, ranges[i], p[4] ** 2, p[6])
            if accepted:
                fused = now
                _smoothed(smooth, now, ranges[i], p[12], p[13])
                if abs(_wrapped(x[2] - line)) < p[15]:
                    v = _window_speed(smooth, pairs, speeds, counts, p, spacing)
                    if speed_estimator and not np.isnan(v):
                        x[3] = p[18] * x[3] + (1 - p[18]) * v
                else:
                    line, counts[0] = x[2], 0
        if not np.isnan(now):
            out[i, :4] = x[:4]
            out[i, 4], out[i, 5], out[i, 6] = P[0, 0], P[0, 1], P[1, 1]
    return out
