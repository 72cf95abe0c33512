"""Note how the messages of each tag arrive, in the columns of `store/arrivals.py`."""

from typing import Any, Final

import numpy as np
from numba import njit

from dropanchor_schemas import kinds
from dropanchor_schemas.wire import MAX_T_NS
from dropanchor_service.store.arrivals import (
    BURST_S,
    BURSTS,
    DELAY_GROWTH,
    FORGOTTEN_BURSTS,
    LATE_S,
    RANGE_S,
    RANGE_WINDOW_S,
    ZEROS,
)

_NAMES = [kind.name for kind in kinds.KINDS]
_IMU: Final = _NAMES.index("imu")
_RANGE: Final = _NAMES.index("range")
_HEADING: Final = _NAMES.index("heading")


@njit(cache=True)  # holds the interpreter's lock, so that no reader sees half of a record
def record_arrivals(
    columns: Any,
    conspicuous: Any,
    forms: Any,
    rows: Any,
    arrived: Any,
    due: Any,
    oldest: Any,
    newest_of: Any,
    ranges: Any,
) -> int:
    """Note one message of each of several rows. Return the least time that the samples of a message span, ns.

    columns: ARRIVAL by row. conspicuous: by row. forms, rows, arrived: of all messages of the turn. due: indices of
    those to note; replays are not. oldest, newest_of: as in `Spans`. ranges: SCALAR, to anchors of the site.
    """
    span, counts, zeros = MAX_T_NS, np.zeros(len(rows), np.int64), np.zeros(len(rows), np.int64)
    for i in range(len(ranges)):
        counts[ranges[i].message] += 1
        zeros[ranges[i].message] += ranges[i].value == 0.0
    for message in due:
        newest = -1
        for kind in range(len(newest_of)):
            newest = max(newest, newest_of[kind, message])
        if newest < 0:
            continue
        span = min(span, newest - oldest[message])
        if forms[message].replay:
            continue
        arrival = columns[rows[message]]
        _note_delay(arrival, arrived[message], oldest[message], newest)
        _count_ranges(arrival, counts[message], newest)
        _note_kinds(arrival, newest_of, message, counts[message], zeros[message])
        conspicuous[rows[message]] = _is_conspicuous(arrival)
    return span


@njit
def _note_delay(arrival: Any, arrival_ns: int, oldest: int, newest: int) -> None:
    """Note when a message came, and how late. A burst follows a silence, and its samples are of that silence."""
    is_first = arrival.arrival_ns == 0
    silence_s = 0.0 if is_first else (arrival_ns - arrival.arrival_ns) * 1e-9
    delay_s = (arrival_ns - newest) * 1e-9
    arrival.delay_s = delay_s if is_first else min(delay_s, arrival.delay_s + DELAY_GROWTH * silence_s)
    fills = (oldest - arrival.newest_ns) * 1e-9 < silence_s / 2
    if (arrival_ns - arrival.burst_ns) * 1e-9 >= FORGOTTEN_BURSTS * max(arrival.burst_s, BURST_S):
        arrival.bursts = 0
    if silence_s > BURST_S and fills:
        arrival.bursts += 1
        arrival.burst_ns, arrival.burst_s = arrival_ns, silence_s
    arrival.arrival_ns, arrival.newest_ns = arrival_ns, newest


@njit
def _count_ranges(arrival: Any, ranges: int, newest: int) -> None:
    """Update the mean time between two ranges, which counts from the first one."""
    if ranges == 0:
        return
    arrival.range_ns = arrival.arrival_ns
    if arrival.counted_ns == 0:
        arrival.counted_ns, arrival.ranges = newest, 0
        return
    arrival.ranges += ranges
    counted_s = (newest - arrival.counted_ns) * 1e-9
    if arrival.counted_ns > 0 and counted_s >= RANGE_WINDOW_S:
        arrival.range_s = counted_s / max(arrival.ranges, 1)
        arrival.counted_ns, arrival.ranges = newest, 0


@njit
def _note_kinds(arrival: Any, newest_of: Any, message: int, ranges: int, zeros: int) -> None:
    """Note when motion came, the newest time of each kind, and how many ranges of 0 came one after another."""
    imu_ns, range_ns, heading_ns = newest_of[_IMU, message], newest_of[_RANGE, message], newest_of[_HEADING, message]
    if imu_ns >= 0 or heading_ns >= 0:
        arrival.motion_ns = arrival.arrival_ns
    arrival.newest_imu_ns = max(arrival.newest_imu_ns, imu_ns)
    if range_ns >= 0:
        arrival.newest_range_ns = range_ns
    arrival.zeros = arrival.zeros + zeros if zeros == ranges else 0


@njit
def _is_conspicuous(arrival: Any) -> Any:
    is_late, has_few = arrival.delay_s >= LATE_S, arrival.range_s > RANGE_S
    return is_late or has_few or arrival.bursts >= BURSTS or arrival.zeros >= ZEROS
