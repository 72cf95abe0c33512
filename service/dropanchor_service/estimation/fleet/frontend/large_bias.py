"""A gyroscope's bias that no data sheet allows: cheap ones read 5 to 20 degrees per second at rest.

Such a tag looks as if it turned evenly. It does not turn if the magnetometer says so: a field m in the body frame that
turned by the angle a would change by |a x m|, and does not change by a tenth of it. Without a field, or about its axis,
only the first rest of a new tag can tell: nobody switches a tag on and turns it evenly, without shaking, for seconds.
A bias that was found so is doubted in the same way, so that a false one goes at the next rest.
The attitude has been turned by the bias all the while. It goes back to where it was, and the field is learned anew.
"""

import math
from typing import Any, TypeAlias

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.standstill import (
    BIAS_SD,
    RATE,
    RATE_KNOWN,
    TAU,
    Standstill,
    is_steady,
)

LARGE_BIAS = np.dtype(
    [
        ("steady_s", "f8"),  # s for which the tag has been steady
        ("q", "f8", 4),  # attitude when that began
        ("turned", "f8", 3),  # rad, integrated rate since then
        ("fields", "f8"),  # samples of the field since then
        ("field", "f8", 3),  # their mean over the last samples
        ("turned_then", "f8", 3),  # rad, mean of `turned` at the same samples
        ("first", "f8", 3),  # `field` after `AVERAGED` samples
        ("turned_first", "f8", 3),  # and `turned_then`
        ("last", "f8", 3),  # sample of the field before
        ("first_rest", "u1"),  # 1: the tag is new, and has been steady all the time since its first sample
    ]
)
LargeBias: TypeAlias = Any  # a record of LARGE_BIAS

UNKNOWN = 0.5  # of the prior's variance, above which no rest has told the bias
AVERAGED = 10.0  # samples of the field that are averaged
LARGEST = 0.5  # rad/s: 20 deg/s of an axis are the worst of data sheets
TURN = 0.1  # relative change of the field that is enough to see
FULL_TURN = 1.0  # relative change after which a field may have come back
STILL = 0.1  # share of it that a field at rest shows
FIRST_REST = 3.0  # s, of the rest that tells without a magnetometer


@njit(nogil=True)
def start_large_bias(one: LargeBias, new: bool) -> None:
    """Start with the first sample. new: it is the first one of the tag, and not of a restart."""
    one.steady_s = 0.0
    one.last[:] = math.nan
    one.first_rest = 1 if new else 0


@njit(nogil=True)
def begin_steady(one: LargeBias, q: Array) -> None:
    """Begin to watch a tag that is steady from now on, in the attitude q."""
    one.q[:] = q
    one.turned[:] = one.field[:] = one.turned_then[:] = 0.0
    one.fields = 0.0


@njit(nogil=True)
def add_field(one: LargeBias, mag: Array) -> None:
    """Add a sample of the field to the mean, and the angle turned until then to its own. Skip one that repeats."""
    if mag[0] == one.last[0] and mag[1] == one.last[1] and mag[2] == one.last[2]:
        return
    one.last[:] = mag
    one.fields += 1.0
    k = 1.0 / min(one.fields, AVERAGED)
    for i in range(3):
        one.field[i] += k * (mag[i] - one.field[i])
        one.turned_then[i] += k * (one.turned[i] - one.turned_then[i])
    if one.fields <= AVERAGED:
        one.first[:] = one.field
        one.turned_first[:] = one.turned_then


@njit(nogil=True)
def changes_of_field(one: LargeBias) -> tuple[float, float]:
    """Return by how much the field would have changed with the gyroscope, and by how much it has, of its size."""
    m, since, then = one.first, one.turned_first, one.turned_then
    x, y, z = then[0] - since[0], then[1] - since[1], then[2] - since[2]
    would = math.sqrt((y * m[2] - z * m[1]) ** 2 + (z * m[0] - x * m[2]) ** 2 + (x * m[1] - y * m[0]) ** 2)
    dx, dy, dz = one.field[0] - m[0], one.field[1] - m[1], one.field[2] - m[2]
    size = math.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2])
    return would / size, math.sqrt(dx * dx + dy * dy + dz * dz) / size


@njit(nogil=True)
def shows_rest(one: LargeBias) -> bool:
    """Return whether what the gyroscope has read since the tag is steady was its bias."""
    would = has = 0.0
    if one.fields > AVERAGED:
        would, has = changes_of_field(one)
    if would > FULL_TURN:
        one.steady_s = 0.0
        return False
    if would < TURN:  # there is no field, or the bias is about its axis
        return one.first_rest == 1 and one.steady_s > FIRST_REST and has < STILL * TURN
    return has < STILL * would


@njit(nogil=True)
def may_be_at_rest(one: LargeBias, s: Standstill) -> bool:
    """Return whether the first steady time of the tag is under way, and it may turn or rest."""
    return one.first_rest == 1 and one.steady_s > 0.0 and s.seen > TAU  # type: ignore[no-any-return]


@njit(nogil=True)
def was_told(s: Standstill, bias: Array) -> bool:
    """Return whether a rest has told the bias, and one that the standstill sees."""
    size = math.sqrt(bias[0] * bias[0] + bias[1] * bias[1] + bias[2] * bias[2])
    return s.bias_var < UNKNOWN * BIAS_SD * BIAS_SD and size < RATE_KNOWN + RATE


@njit(nogil=True)
def take_rate(one: LargeBias, s: Standstill, bias: Array) -> bool:
    """Take the mean rate since the tag is steady for bias, if it is still the same and a bias can be as large."""
    square = change = 0.0
    for i in range(3):
        mean = bias[i] + one.turned[i] / one.steady_s
        square += mean * mean
        change += (s.mean[3 + i] - mean) ** 2
    if square > LARGEST * LARGEST or change > RATE_KNOWN * RATE_KNOWN:
        return False
    for i in range(3):
        bias[i] += one.turned[i] / one.steady_s
    return True


@njit(nogil=True)
def found_large_bias(one: LargeBias, s: Standstill, dt: float, gyro: Array, bias: Array, mag: Array, q: Array) -> bool:
    """Take one sample before its rate turns the attitude. Return whether `bias` and q are set to what a rest told."""
    steady = is_steady(s)
    if not steady:
        one.first_rest = 0
    if not steady or s.quiet > 0.0 or dt == 0.0 or was_told(s, bias):
        one.steady_s = 0.0
        return False
    if one.steady_s == 0.0:
        begin_steady(one, q)
    one.steady_s += dt
    for i in range(3):
        one.turned[i] += dt * (gyro[i] - bias[i])
    if math.isfinite(mag[0] + mag[1] + mag[2]):
        add_field(one, mag)
    if not shows_rest(one):
        return False
    found = take_rate(one, s, bias)
    if found:
        q[:] = one.q
    one.steady_s = 0.0
    return found
