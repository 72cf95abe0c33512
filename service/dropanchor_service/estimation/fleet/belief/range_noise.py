"""How much the ranges of a tag scatter, learned from them: the noise is a state of the row.

Two parts add up. What is new in every range shows in second differences of consecutive ranges, whatever the track. An
error that lasts for seconds does not; it shows where the innovations of a block have one sign. Such a block says as
much as one range, so the variance of each of its ranges is larger by a factor 4^k, and k is a level with a probability
for each value. The levels start even, or nearly so: a tag is not believed to be precise before it has shown it.
"""

import math
from typing import Final

from dropanchor_service.estimation.fleet.belief.layout import (
    MOUNT,
    NOISE_LEVELS,
    PHI,
    RANGE_BIAS,
    Hypotheses,
    N,
    R,
    Row,
    V,
)
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.node import Node
from dropanchor_service.estimation.fleet.tuning import Tuning

CLIP: Final = 6.0  # times the variance that one difference or innovation counts at most
FIRST: Final = 5.0  # ranges that the variance of before counts for at the start
MEMORY: Final = 200.0  # ranges that are remembered
MAX_GAP_NS: Final = 350_000_000  # ns between ranges, beyond which a difference tells of motion
FACTOR: Final = 4.0  # of the variance, from one level to the next
TOLD_LEVELS: Final = 3  # of a told noise: beyond four times its deviation the track is wrong, not the ranges
PLACE_VAR: Final = 25.0  # m^2, to which doubt may widen a place
NEAR: Final = 2.0  # m from the anchor, below which it widens the bearing no more
SPEED_VAR: Final = 1.0  # (m/s)^2, to which it may widen a speed


@njit(nogil=True)
def reported_var(row: Row, node: Node) -> float:
    """Return the variance of a range, m^2, that it reports itself, else that of the settings."""
    std = node.z_std if math.isfinite(node.z_std) and node.z_std > 0.0 else row.settings.range_std
    return float(std * std)


@njit(nogil=True)
def _levels(row: Row) -> int:
    """Return how many levels the errors that last may have."""
    return TOLD_LEVELS if row.noise.told == 1 else NOISE_LEVELS


@njit(nogil=True)
def _mean_factor(row: Row) -> float:
    """Return the mean of the factor, and normalise the levels."""
    log_p = row.noise.log_p
    best = -math.inf
    for k in range(_levels(row)):
        best = max(best, log_p[k])
    total = mean = 0.0
    for k in range(_levels(row)):
        log_p[k] -= best
        total += math.exp(log_p[k])
        mean += math.exp(log_p[k]) * FACTOR**k
    return mean / total


@njit(nogil=True)
def _start(row: Row, node: Node, t: Tuning) -> None:
    """Begin with the noise that was told, or with that of a good radio and every level of lasting errors."""
    noise = row.noise
    noise.white_var = reported_var(row, node)
    noise.told = 1 if row.settings.range_std_given == 1 or node.z_std > 0.0 else 0
    step = t.noise_told_log_prior if noise.told == 1 else t.noise_log_prior
    for k in range(_levels(row)):
        noise.log_p[k] = k * step
    noise.count = noise.block_s = noise.error = noise.spread = noise.white = noise.lasting_var = 0.0
    noise.block_ranges = 0
    noise.t_ns[:] = 0
    noise.factor = noise.peak = _mean_factor(row)


@njit(nogil=True)
def learn_white(row: Row, node: Node, t: Tuning) -> None:
    """Learn what is new in every range from the second difference of the last three to the primary anchor."""
    noise = row.noise
    if noise.white_var == 0.0:
        _start(row, node, t)
    if node.anchor != row.anchor:
        return
    first, second = noise.t_ns[0], noise.t_ns[1]
    if second > 0 and first > 0 and node.t_ns - second <= MAX_GAP_NS and second - first <= MAX_GAP_NS:
        a, b = float(node.t_ns - second), float(second - first)
        share = a / b  # 1 where they come at equal intervals
        d = node.z - (1.0 + share) * noise.z[1] + share * noise.z[0]
        seen = d * d / (1.0 + (1.0 + share) ** 2 + share**2)
        noise.count = min(noise.count + 1.0, MEMORY)
        noise.white_var += (min(seen, CLIP * noise.white_var) - noise.white_var) / (FIRST + noise.count)
        noise.white_var = max(noise.white_var, reported_var(row, node))
    noise.z[0], noise.t_ns[0] = noise.z[1], noise.t_ns[1]
    noise.z[1], noise.t_ns[1] = node.z, node.t_ns


@njit(nogil=True)
def learn_lasting(
    work: Hypotheses, count: int, row: Row, e: float, S: float, R_used: float, dt: float, t: Tuning
) -> None:
    """Add an innovation e of all hypotheses together, of variance S, to the block, and close the block when it is full.

    R_used: the variance of the range, m^2, as it was used. Of a noise level k the sum of the block has the variance
    sum(S - R_used) + 4^k sum(white).
    """
    noise = row.noise
    limit = math.sqrt(CLIP * S)
    noise.error += min(max(e, -limit), limit)
    noise.spread += max(S - R_used, 0.0)
    noise.white += noise.white_var
    noise.block_s += dt
    noise.block_ranges += 1
    if noise.block_s >= t.noise_block_s:
        _close_block(row, t)
        ratio = noise.factor / noise.peak
        if ratio > 1.0:
            if noise.told == 0:  # a told noise is right: if ranges disagree, the track starts again elsewhere
                doubt(work, count, row, ratio)
            noise.peak = noise.factor


@njit(nogil=True)
def _close_block(row: Row, t: Tuning) -> None:
    """Judge the levels by the block that is full, and begin another one."""
    noise = row.noise
    step = t.noise_told_log_prior if noise.told == 1 else t.noise_log_prior
    kept = math.exp(-noise.block_s / t.noise_memory_s)
    for k in range(_levels(row)):
        variance = noise.spread + FACTOR**k * noise.white
        seen = -0.5 * (noise.error**2 / variance + math.log(variance))
        noise.log_p[k] = kept * noise.log_p[k] + (1.0 - kept) * k * step + seen
    noise.factor = _mean_factor(row)
    noise.lasting_var = noise.white_var * (noise.factor - 1.0) / noise.block_ranges
    noise.peak = max(1.0, noise.peak * math.exp(-noise.block_s / t.noise_peak_s))
    noise.block_s = noise.error = noise.spread = noise.white = 0.0
    noise.block_ranges = 0


@njit(nogil=True)
def doubt(work: Hypotheses, count: int, row: Row, ratio: float) -> None:
    """Take back what the ranges said while they were believed to be `ratio` times as good, in variance.

    Weights become more even, and covariances grow, each to what it was at the start at most.
    """
    settings = row.settings
    for h in range(count):
        one = work[h]
        one.log_weight /= ratio
        P = one.cov
        for i in range(N):
            most = _at_start(i, one.mean[R], settings)
            if most <= P[i, i] or P[i, i] <= 0.0:
                continue
            grow = math.sqrt(min(ratio, most / P[i, i]))
            for j in range(N):
                P[i, j] *= grow
                P[j, i] *= grow


@njit(nogil=True)
def _at_start(i: int, r: float, settings: Row) -> float:
    """Return the variance of a state that is not known. 0: ranges do not tell it."""
    if i == R:
        return PLACE_VAR
    if i == PHI:
        return PLACE_VAR / max(r, NEAR) ** 2
    if i == V:
        return SPEED_VAR
    if i == MOUNT:
        return float(settings.mount_angle_std**2)
    if i == RANGE_BIAS:
        return float(settings.range_bias_std**2)
    return 0.0
