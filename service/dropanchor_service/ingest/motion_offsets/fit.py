"""Fit the ranges of one window to the path that the gyroscope describes, for every lag between both clocks.

A tag that moves at a constant speed v along the path D(t) = ∫ m (cos ψ, sin ψ) dt, with the yaw ψ from the gyroscope
and m = 1 while it moves, has r² = |p + v D|² + h² = a + b·D + v² |D|². This is linear in a, b and v². The residuals are
least at the lag of the clocks. Turns and stops make the minimum sharp. A speed that varies makes the residuals large.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.motion_offsets.bins import BIN_S, Motion

MAX_LAG_BINS = 30
MIN_RANGES = 60
MAX_RESIDUAL_M = 0.3
MAX_NOISE_RATIO = 2.0  # of the residuals and the noise of the ranges themselves
MIN_NOISE_M = 0.05
MIN_DEPTH = 1.5  # of the residuals at most lags and the least ones
MAX_HALF_WIDTH_S = 0.5
MIN_INDEPENDENT = 10.0  # residuals
MIN_SPEED2 = 0.02  # (m/s)²
_OUTLIER = 4.0  # standard deviations
_PARAMETERS = 5
_LEVEL = 4.0  # rise of χ² that bounds 95 %


class Minimum(NamedTuple):
    """lag_s: of the least residuals; positive: the clock of the motion is ahead. half_width_s: of the minimum."""

    lag_s: float
    half_width_s: float


class Profile(NamedTuple):
    """chi2: (lags,) sum of the squared residuals, m². residuals: at the best lag, m. speed2: v² there, (m/s)²."""

    chi2: Array
    residuals: Array
    speed2: float


def fit(motion: Motion, ranges: Array) -> Minimum | None:
    """Return where the residuals are least, None where the motion does not tell.

    ranges: (n,), m, NaN: none. motion: (n + 2 MAX_LAG_BINS,), from MAX_LAG_BINS before the first range.
    """
    used = np.flatnonzero(np.isfinite(ranges))
    if len(used) < MIN_RANGES or not motion.moving.any():
        return None
    profile = _profile(*_paths(motion, len(ranges), used), ranges[used])
    best = int(profile.chi2.argmin())
    residual_m = math.sqrt(profile.chi2[best] / len(profile.residuals))
    noise_m = max(_noise_m(ranges[used]), MIN_NOISE_M)
    independent = len(profile.residuals) / _correlation(profile.residuals)
    if (
        residual_m > min(MAX_RESIDUAL_M, MAX_NOISE_RATIO * noise_m)
        or np.median(profile.chi2) < MIN_DEPTH**2 * profile.chi2[best]
        or profile.speed2 < MIN_SPEED2
        or independent < MIN_INDEPENDENT
    ):
        return None
    return _minimum(profile.chi2, best, profile.chi2[best] * (1.0 + _LEVEL / (independent - _PARAMETERS)))


def _paths(motion: Motion, n: int, used: Array) -> tuple[Array, Array]:
    """Return x and y of the path at speed 1 at the time of each range, both (lags, ranges) m."""
    yaw = np.cumsum(motion.yaw_rate) * BIN_S - motion.yaw_rate * (BIN_S / 2)
    x, y = (np.cumsum(motion.moving * direction) * BIN_S for direction in (np.cos(yaw), np.sin(yaw)))
    return sliding_window_view(x, n)[:, used], sliding_window_view(y, n)[:, used]


def _profile(x: Array, y: Array, ranges: Array) -> Profile:
    """Return the residuals of every lag, after a second fit without the outliers of the best lag."""
    profile = _least_squares(x, y, ranges)
    residuals = profile.residuals
    std = 1.48 * float(np.median(np.abs(residuals - np.median(residuals))))
    kept = np.abs(residuals) < _OUTLIER * max(std, MIN_NOISE_M / 2)
    if kept.all() or kept.sum() < MIN_RANGES // 2:  # the lag is wrong rather than most ranges
        return profile
    return _least_squares(x[:, kept], y[:, kept], ranges[kept])


def _least_squares(x: Array, y: Array, ranges: Array) -> Profile:
    """Fit r² at every lag. Residuals of r² over 2 r are those of r."""
    x, y = x - x.mean(axis=1, keepdims=True), y - y.mean(axis=1, keepdims=True)
    weight = 0.5 / np.maximum(ranges, 1.0)
    design = np.stack([np.ones_like(x), x, y, x * x + y * y], axis=2) * weight[:, None]
    squared = ranges * ranges
    measured = (squared - squared.mean()) * weight
    q, r = np.linalg.qr(design)
    along = np.einsum("lmi,m->li", q, measured)
    residuals = measured - np.einsum("lmi,li->lm", q, along)
    chi2 = (residuals * residuals).sum(axis=1)
    best = int(chi2.argmin())
    speed2 = along[best, 3] / r[best, 3, 3] if r[best, 3, 3] else 0.0
    return Profile(chi2, residuals[best], float(speed2))


def _noise_m(ranges: Array) -> float:
    """Return the noise of the ranges from their second differences, which a smooth motion hardly changes."""
    return 1.48 * float(np.median(np.abs(np.diff(ranges, 2)))) / math.sqrt(6.0)


def _correlation(residuals: Array) -> float:
    """Return how many residuals in a row are worth one independent residual."""
    residuals = residuals - residuals.mean()
    variance, length = max(float((residuals * residuals).mean()), 1e-12), 1.0
    for apart in range(1, min(60, len(residuals) // 2)):
        correlation = float((residuals[apart:] * residuals[:-apart]).mean()) / variance
        if correlation < 0.05:
            break
        length += 2.0 * correlation
    return length


def _minimum(chi2: Array, best: int, level: float) -> Minimum | None:
    """Return the minimum, None if it is wide, not the only one, or at the end of the lags. level: of its bounds."""
    inside = np.flatnonzero(chi2 <= level)
    first, last = int(inside[0]), int(inside[-1])
    half_width_s = (last - first + 1) / 2 * BIN_S
    if first == 0 or last == len(chi2) - 1 or half_width_s >= MAX_HALF_WIDTH_S:
        return None
    before, least, after = chi2[best - 1 : best + 2]
    vertex = (before - after) / max(2.0 * (before - 2.0 * least + after), 1e-12)
    return Minimum((best - MAX_LAG_BINS + float(vertex)) * BIN_S, half_width_s)
