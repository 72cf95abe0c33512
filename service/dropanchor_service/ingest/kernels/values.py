"""Judge the values and times of samples: whether a sensor can have measured them."""

import math
from typing import Any, Final

from numba import njit

from dropanchor_schemas.times import EARLIEST_UTC_NS
from dropanchor_schemas.wire import MAX_T_NS

# A value beyond what such sensors can measure is absurd. The widest ranges of consumer IMUs are ±30 g and ±4,000 °/s
# (TDK ICM-20649, DS-000192) and ±4,912 µT (Asahi Kasei AK09916); UWB radios end far below 3 km.
ACC_LIMIT: Final = 320.0  # m/s², each axis
GYRO_LIMIT: Final = 72.0  # rad/s, each axis
MAG_LIMIT: Final = 5_000.0  # µT, each axis

GOOD: Final = 0
NOT_FINITE: Final = 1
ABSURD: Final = 2
NEGATIVE: Final = 3
STD_INVALID: Final = 4


@njit(nogil=True)
def _fault_of(a: float, b: float, c: float, limit: float) -> int:
    if abs(a) <= limit and abs(b) <= limit and abs(c) <= limit:  # false for NaN
        return GOOD
    return ABSURD if math.isfinite(a) and math.isfinite(b) and math.isfinite(c) else NOT_FINITE


@njit(cache=True, nogil=True)
def judge_imu(imu: Any, verdicts: Any) -> int:
    """Judge each IMU sample: GOOD, NOT_FINITE or ABSURD. Return how many are not good.

    An absent magnetometer, three NaN, is good.
    """
    bad = 0
    for i in range(len(imu)):
        a, w, m = imu[i].acc, imu[i].gyro, imu[i].mag
        acc, gyro = _fault_of(a[0], a[1], a[2], ACC_LIMIT), _fault_of(w[0], w[1], w[2], GYRO_LIMIT)
        mag = _fault_of(m[0], m[1], m[2], MAG_LIMIT)
        if mag == NOT_FINITE and math.isnan(m[0]) and math.isnan(m[1]) and math.isnan(m[2]):
            mag = GOOD
        unknown = acc == NOT_FINITE or gyro == NOT_FINITE or mag == NOT_FINITE
        verdicts[i] = NOT_FINITE if unknown else max(acc, gyro, mag)
        bad += verdicts[i] != GOOD
    return bad


@njit(cache=True, nogil=True)
def judge_scalars(
    values: Any, stds: Any, low: float, high: float, std_low: float, std_high: float, verdicts: Any
) -> int:
    """Judge ranges, headings or bearings, which must lie between `low` and `high`. Return how many are not good.

    A value below `low` is NEGATIVE. A std may be NaN: unknown.
    """
    bad = 0
    for i in range(len(values)):
        value, std = values[i], stds[i]
        if not math.isfinite(value):
            verdicts[i] = NOT_FINITE
        elif value < low:
            verdicts[i] = NEGATIVE
        elif value > high:
            verdicts[i] = ABSURD
        elif std < std_low or std > std_high:
            verdicts[i] = STD_INVALID
        else:
            verdicts[i] = GOOD
        bad += verdicts[i] != GOOD
    return bad


@njit(cache=True, nogil=True)
def shift_times(t_ns: Any, messages: Any, offsets: Any) -> int:
    """Add to each time the offset of its message. Return how many times then cannot be UTC.

    offsets: ns, empty if all of them are 0.
    """
    outside = 0
    for i in range(len(t_ns)):
        if len(offsets):
            t_ns[i] += offsets[messages[i]]
        outside += not EARLIEST_UTC_NS <= t_ns[i] < MAX_T_NS
    return outside


@njit(cache=True, nogil=True)
def newest_times(t_ns: Any, messages: Any, kind: int, newest: Any, counts: Any) -> None:
    """Raise `newest` of each message to the latest time of its samples of one kind, and count them.

    newest: (n, 3), of motion, ranges and the other kinds. counts: (n, 3). kind: index in `KINDS`.
    """
    column = min(kind, 2)
    for i in range(len(t_ns)):
        counts[messages[i], column] += 1
        newest[messages[i], column] = max(newest[messages[i], column], t_ns[i])


@njit(cache=True, nogil=True)
def time_spans(t_ns: Any, messages: Any, oldest: Any, newest: Any) -> None:
    """Widen the span of each message, from `oldest` to `newest`, to the times of its samples."""
    for i in range(len(t_ns)):
        oldest[messages[i]] = min(oldest[messages[i]], t_ns[i])
        newest[messages[i]] = max(newest[messages[i]], t_ns[i])
