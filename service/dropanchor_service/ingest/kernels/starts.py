"""Add what ranges say to the starts that they may deny. NumPy took longer for a few tags than the rest of the watch."""

import math
import sys
from typing import Any, Final

import numpy as np
from numba import njit

from dropanchor_service.estimation.columns import MeasurementKind

MOVING_S: Final = 2.0
MOVING_M: Final = 3.0
STANDING_S: Final = 10.0
SETTLED_M: Final = 50.0  # way over which the ranges agreed: then a contradiction is no longer one of the start
MAX_NIS: Final = 9.0  # of a range that agrees: three standard deviations
MAX_LASTING_M: Final = 0.5  # of errors of ranges that last: if they are believed to be larger, ranges confirm nothing
MAX_STEP_S: Final = 0.5  # between two ranges: a longer silence says nothing about the way

OPEN: Final = np.dtype(
    [
        ("is_open", "?"),  # ranges may still deny it
        ("is_confirmed", "?"),
        ("is_enough", "?"),  # what ranges have said confirms it
        ("agreed_s", "f8"),  # since the last range that did not agree
        ("agreed_m", "f8"),
        ("way_m", "f8"),  # over which ranges agreed, in all
        ("last_ns", "i8"),  # of the last pose, 0: none
    ]
)

_RANGE: Final = int(MeasurementKind.RANGE)
_FASTEST: Final = sys.float_info.max
_NEVER: Final = -1  # ns
_DENIES: Final = 0
_AGREES: Final = 1
_UNKNOWN: Final = 2  # the range met no belief


@njit(cache=True, nogil=True)
def follow_starts(poses: Any, innovations: Any, starts: Any, rows: Any) -> Any:
    """Add what the ranges of these POSE say to OPEN, which is by row.

    innovations: INNOVATION. Those of a row stand side by side, and so do its poses. rows: receives the rows of open
    starts. Returns how many these are, and whether one of them has become confirmed or settled.
    """
    count, has_news, place, met_ns, agreed = 0, False, 0, _NEVER, _UNKNOWN
    for i in range(len(poses)):
        pose = poses[i]
        row = pose.row
        if row >= len(starts) or not starts[row].is_open:
            continue
        if count == 0 or rows[count - 1] != row:
            rows[count] = row
            count += 1
            place, met_ns = _first_of(innovations, row, place), _NEVER
        while place < len(innovations) and innovations[place].row == row and innovations[place].t_ns <= pose.t_ns:
            if innovations[place].kind == _RANGE:
                met_ns, agreed = innovations[place].t_ns, _agrees(innovations[place])
            place += 1
        _add(starts[row], pose.t_ns, pose.speed, agreed if met_ns == pose.t_ns else _UNKNOWN)
        start = starts[row]
        has_news |= start.is_enough and (not start.is_confirmed or start.way_m >= SETTLED_M)
    return count, has_news


@njit(nogil=True)
def _first_of(innovations: Any, row: int, place: int) -> int:
    """Return the place of the first innovation of a row, which is mostly `place`, or how many there are."""
    for i in range(place, len(innovations)):
        if innovations[i].row == row:
            return i
    for i in range(place):
        if innovations[i].row == row:
            return i
    return len(innovations)


@njit(nogil=True)
def _agrees(innovation: Any) -> int:
    is_near = innovation.innovation * innovation.innovation < MAX_NIS * innovation.S
    return _AGREES if innovation.fused and is_near and not innovation.lasting_std > MAX_LASTING_M else _DENIES


@njit(nogil=True)
def _add(start: Any, t_ns: int, speed: float, agrees: int) -> None:
    """Add what one range says: _AGREES, _DENIES or _UNKNOWN."""
    step_s = min(max((t_ns - start.last_ns) * 1e-9, 0.0), MAX_STEP_S)
    if start.last_ns == 0 or agrees != _AGREES:
        step_s = 0.0
    step_m = (0.0 if math.isnan(speed) else min(abs(speed), _FASTEST)) * step_s
    start.last_ns = t_ns
    start.way_m += step_m
    start.agreed_s = 0.0 if agrees == _DENIES else start.agreed_s + step_s
    start.agreed_m = 0.0 if agrees == _DENIES else start.agreed_m + step_m
    moved = start.agreed_m >= MOVING_M and start.agreed_s >= MOVING_S
    start.is_enough = start.is_enough or moved or start.agreed_s >= STANDING_S
