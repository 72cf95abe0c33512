"""Turning: whether gravity and the field turn by what the gyroscope tells.

Up in the body frame, u, follows du/dt = -ω × u, and a field m + b with a constant offset b of the body follows
dm/dt = -s ω × m + ω × b with s = 1. Both hold for every mounting, and neither for axes in another order, with other
signs or in another unit.
"""

import math
from typing import Final

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.plausibility.layout import GOOD, Check, may_be_used
from dropanchor_service.estimation.plausibility.vectors import Vector, combined, cross, dot, norm
from dropanchor_service.estimation.plausibility.verdicts import ImuVerdict

LEAST_SAMPLES: Final = 3  # of a block
CALM = (9.0, 10.6)  # m/s², norms at which an acceleration is hardly more than gravity
LONGEST_S, LONGEST_TURN = 5.0, 3.0  # s, rad, between two calm blocks that are compared
ENOUGH_TURN, SOON_S = 0.4, 1.2  # rad, s: less is not compared yet; the bias of a gyroscope tilts less in this time
TILT: Final = 0.2  # rad, between two calm blocks
MOSTLY: Final = 0.7  # of the turn is tilting
STILL, STOOD = 0.4, 0.25  # of what the gyroscope tells, if gravity hardly moves at all
AT_MOST: Final = 0.5  # rad², that one comparison counts for
ENOUGH: Final = 0.2  # rad²
CONTRADICTED, AGREED = 0.6, 0.4  # share of the tilting
DOUBTED_S: Final = 10.0  # after gravity has stayed where it was although the gyroscope told a tilt
TURNED_WELL: Final = 2.0  # rad, without a contradiction
FORGET_S: Final = 60.0
PEAK_S: Final = 30.0
FAST: Final = 5.0  # rad/s: what carries a tag turns slower on average over half a second
TOO_FAST: Final = 12.0  # rad/s
FIELD_TURN = (0.1, 1.5)  # rad, of a block that tells how the field turns
FIELD_BLOCKS: Final = 4
FIELD_KEPT: Final = 0.98
FIELD_EXPLAINED: Final = 0.7  # share of the changes of the field
FIELD_SURE, FIELD_DOUBTED = 8.0, 5.0  # standard deviations
OPPOSITE, SAME = -0.4, 0.5

AXES_DIFFER, AXES_DOUBTED = int(ImuVerdict.AXES_DIFFER), int(ImuVerdict.AXES_DOUBTED)
GYRO_IN_DEG = int(ImuVerdict.GYRO_IN_DEG)
TURNS_DIFFER, TURNS_DOUBTED = int(ImuVerdict.TURNS_DIFFER), int(ImuVerdict.TURNS_DOUBTED)


@njit(nogil=True)
def judge_turning(c: Check, acc: Vector, gyro: Vector, n: int, seconds: float, apart: float) -> int:
    """Return the verdict on the gyroscope, given the present one. apart: s, from the block before."""
    rate_before: Vector = (c.before.gyro[0], c.before.gyro[1], c.before.gyro[2])
    rate = norm(gyro)
    c.peak = max(c.peak * (1.0 - seconds / PEAK_S), rate)
    kept = 1.0 - seconds / FORGET_S
    c.tilted *= kept
    c.contradicted *= kept
    turn = combined(gyro, 0.5 * apart, rate_before, 0.5 * apart)
    if min(n, c.before.n) >= LEAST_SAMPLES:
        _follow(c, turn)
        _compare_with_gravity(c, acc, turn)
    else:
        c.calm_ns = 0
    if c.imu_verdict in (AXES_DIFFER, GYRO_IN_DEG):
        agrees = c.tilted > ENOUGH and c.contradicted < AGREED * c.tilted
        if agrees or (c.turned > TURNED_WELL and c.peak < 0.5 * FAST):
            return GOOD
        return GYRO_IN_DEG if c.peak > FAST else int(c.imu_verdict)
    if not may_be_used(c.imu_verdict):
        return int(c.imu_verdict)
    if rate > TOO_FAST and norm(rate_before) > TOO_FAST:
        return GYRO_IN_DEG
    if c.tilted > ENOUGH and c.contradicted > CONTRADICTED * c.tilted:
        c.imu_detail = _greatest(c.rates)
        return GYRO_IN_DEG if c.peak > FAST else AXES_DIFFER
    c.doubted_s = max(0.0, c.doubted_s - seconds)
    if c.imu_verdict in (GOOD, AXES_DOUBTED):
        return AXES_DOUBTED if c.doubted_s > 0.0 else GOOD
    return int(c.imu_verdict)


@njit(nogil=True)
def _follow(c: Check, turn: Vector) -> None:
    """Turn the direction that was up against `turn`, by which the body turned as the gyroscope tells it."""
    angle = norm(turn)
    if c.calm_ns == 0 or angle == 0.0:
        return
    up: Vector = (c.told_up[0], c.told_up[1], c.told_up[2])
    axis = combined(turn, 1.0 / angle, turn, 0.0)
    kept = combined(up, math.cos(angle), axis, (1.0 - math.cos(angle)) * dot(axis, up))
    turned = combined(kept, 1.0, cross(axis, up), -math.sin(angle))
    for i in range(3):
        c.told_up[i] = turned[i]
    c.told_turn += angle


@njit(nogil=True)
def _compare_with_gravity(c: Check, acc: Vector, turn: Vector) -> None:
    """Compare where the gyroscope says that up is with where gravity shows it, as soon as both can be told."""
    length = norm(acc)
    if not CALM[0] < length < CALM[1]:
        return
    up = combined(acc, 1.0 / length, acc, 0.0)
    apart_s = (c.t_ns - c.calm_ns) * 1e-9
    if c.calm_ns > 0 and apart_s < LONGEST_S and c.told_turn < LONGEST_TURN:
        if c.told_turn < ENOUGH_TURN and apart_s < SOON_S:
            return  # a slow turn shows over several blocks
        was: Vector = (c.up[0], c.up[1], c.up[2])
        told: Vector = (c.told_up[0], c.told_up[1], c.told_up[2])
        tilt = norm(combined(told, 1.0, was, -1.0))
        shown = norm(combined(up, 1.0, was, -1.0))
        _add_tilt(c, turn, tilt, shown, norm(combined(told, 1.0, up, -1.0)))
    c.calm_ns, c.told_turn = c.t_ns, 0.0
    for i in range(3):
        c.up[i] = c.told_up[i] = up[i]


@njit(nogil=True)
def _add_tilt(c: Check, turn: Vector, tilt: float, shown: float, error: float) -> None:
    """Add a comparison. tilt: what the gyroscope told, shown: what gravity showed, error: between both, rad."""
    if c.told_turn < ENOUGH_TURN or tilt < max(TILT, MOSTLY * min(c.told_turn, 1.0)):
        if c.told_turn > 0.5 * TILT:
            c.turned += c.told_turn
        return
    still = shown < STILL * tilt
    counted = (2.0 if still else 0.5) * min(tilt * tilt, AT_MOST)
    share = (error / tilt) ** 2
    c.tilted += counted
    c.contradicted += counted * min(share, 2.0)
    if share > CONTRADICTED:
        c.turned = 0.0
        c.doubted_s = DOUBTED_S if shown < STOOD * tilt else c.doubted_s
        for i in range(3):
            c.rates[i] += turn[i] * turn[i]


@njit(nogil=True)
def _greatest(values: Array) -> int:
    best = 0
    for i in range(1, 3):
        if values[i] > values[best]:
            best = i
    return best


@njit(nogil=True)
def judge_field(c: Check, gyro: Vector, mag: Vector, apart: float) -> int:
    """Return the verdict on how the field turns, given the present one. apart: s, from the block before."""
    before: Vector = (c.before.mag[0], c.before.mag[1], c.before.mag[2])
    rate_before: Vector = (c.before.gyro[0], c.before.gyro[1], c.before.gyro[2])
    turn = combined(gyro, 0.5 * apart, rate_before, 0.5 * apart)
    known = may_be_used(c.imu_verdict) or c.imu_verdict == TURNS_DIFFER
    if not (known and FIELD_TURN[0] < norm(turn) < FIELD_TURN[1]):
        return int(c.imu_verdict)
    _add_field(c, turn, cross(combined(mag, 0.5, before, 0.5), turn), combined(mag, 1.0, before, -1.0))
    if c.field_blocks < FIELD_BLOCKS:
        return int(c.imu_verdict)
    factor, deviations = _factor(c.normal, c.told, c.field2, c.field_blocks)
    if c.imu_verdict == TURNS_DIFFER:
        return GOOD if deviations > FIELD_SURE and factor > SAME else TURNS_DIFFER
    if deviations < -FIELD_SURE and factor < OPPOSITE:
        return TURNS_DIFFER
    if deviations < -FIELD_DOUBTED and factor < OPPOSITE:
        return TURNS_DOUBTED
    return GOOD if c.imu_verdict == TURNS_DOUBTED else int(c.imu_verdict)


@njit(nogil=True)
def _add_field(c: Check, turn: Vector, predicted: Vector, change: Vector) -> None:
    """Add one block to the normal equations of change = s · predicted + turn × b."""
    x, y, z = turn
    rows = ((predicted[0], 0.0, -z, y), (predicted[1], z, 0.0, -x), (predicted[2], -y, x, 0.0))
    for i in range(4):
        for j in range(4):
            c.normal[i, j] *= FIELD_KEPT
        c.told[i] *= FIELD_KEPT
    c.field2 *= FIELD_KEPT
    for k in range(3):
        row = rows[k]
        for i in range(4):
            for j in range(4):
                c.normal[i, j] += row[i] * row[j]
            c.told[i] += row[i] * change[k]
        c.field2 += change[k] * change[k]
    c.field_blocks = min(c.field_blocks + 1, 50)


@njit(nogil=True)
def _factor(normal: Array, told: Array, field2: float, blocks: int) -> tuple[float, float]:
    """Return the factor s and how many standard deviations it is from 0; 0 where the model does not explain the field.

    Gauss elimination: no kernel here calls BLAS.
    """
    a = normal.copy()
    x, solution = told.copy(), told.copy()
    least = 1e-9 * (a[0, 0] + a[1, 1] + a[2, 2] + a[3, 3])
    for i in range(4):
        a[i, i] += least
    for k in range(3, 0, -1):  # the last unknowns first, so that s remains
        for i in range(k):
            share = a[i, k] / a[k, k]
            for j in range(k + 1):
                a[i, j] -= share * a[k, j]
            x[i] -= share * x[k]
    if not a[0, 0] > 0.0:
        return 0.0, 0.0
    factor = x[0] / a[0, 0]
    # Forward substitution for the offset, and from that what the model explains.
    solution[0] = factor
    for k in range(1, 4):
        rest = x[k]
        for j in range(k):
            rest -= a[k, j] * solution[j]
        solution[k] = rest / a[k, k]
    explained = 0.0
    for i in range(4):
        explained += solution[i] * told[i]
    variance = max(field2 - explained, 1e-9 * field2) / max(3 * blocks - 4, 1) / a[0, 0]
    if explained < FIELD_EXPLAINED * field2 or not variance > 0.0:
        return factor, 0.0
    return factor, factor / math.sqrt(variance)
