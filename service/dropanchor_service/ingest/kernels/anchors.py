"""Add what ranges say of the anchors that they are to. NumPy would take longer than the rest of the watch."""

import math
from typing import Any, Final

import numpy as np
from numba import njit

from dropanchor_service.estimation.columns import MeasurementKind

SLOTS: Final = 4  # anchors of a row; those of equal remainder share a slot
OUTLIER: Final = 0.5  # probability above which a range contradicts the track
STEP_RANGES: Final = 3  # in a row that contradict it,
STEP_NS: Final = 200_000_000  # for so long,
CLEAN_S: Final = 5.0  # after so long without one: then the ranges to an anchor have made a step
LONG_RANGES: Final = 5  # the same of a step that lasts: many tracks soon explain it in another way
LONG_NS: Final = 800_000_000
LONGEST_S: Final = 1.0  # between two ranges: a longer silence says nothing
AWAY_NS: Final = 60_000_000_000  # without a range to an anchor, after which the next one is a first one again

HEARD: Final = np.dtype(
    [
        ("anchor", "i4", (SLOTS,)),
        ("last_ns", "i8", (SLOTS,)),  # of its last range, 0: none
        ("clean_s", "f8", (SLOTS,)),  # for which its ranges have agreed with the track
        ("before_s", "f8", (SLOTS,)),  # the same, before those that contradict it now
        ("run", "i4", (SLOTS,)),  # ranges in a row that contradict it
        ("run_ns", "i8", (SLOTS,)),  # since when
        ("sum", "f8", (SLOTS,)),  # m, of their innovations
    ]
)
STEP: Final = np.dtype([("row", "i4"), ("anchor", "i4"), ("t_ns", "i8"), ("way", "f8"), ("lasts", "?"), ("std", "f8")])
"""way: m, by which the ranges of a row to an anchor are longer since t_ns. A step that lasts is told twice.

std: m, of the way of a first range, 0: the row has heard the anchor before. A first range has taught the track nothing.
"""

_TOLD: Final = -1.0  # s before a step that was told once
_RANGE: Final = int(MeasurementKind.RANGE)


@njit(cache=True, nogil=True)
def follow_anchors(innovations: Any, heard: Any, steps: Any) -> Any:
    """Add INNOVATION to HEARD, which is by row. Fill STEP, one at most for each of them, and return how many.

    Every first range of a row to an anchor is one, whether it agrees or not.
    """
    count = 0
    for i in range(len(innovations)):
        one = innovations[i]
        if one.kind != _RANGE or not one.p_outlier >= 0.0:
            continue
        row, slot = heard[one.row], one.anchor % SLOTS
        is_first = row.last_ns[slot] == 0 or one.t_ns - row.last_ns[slot] > AWAY_NS
        if row.anchor[slot] != one.anchor or row.last_ns[slot] == 0:
            row.anchor[slot], row.clean_s[slot], row.run[slot] = one.anchor, 0.0, 0
            row.last_ns[slot] = one.t_ns
        step = steps[count]
        if _makes_step(row, slot, one):
            step.row, step.anchor, step.t_ns, step.std = one.row, one.anchor, row.run_ns[slot], 0.0
            step.way, step.lasts = row.sum[slot] / row.run[slot], row.before_s[slot] == 0.0
            count += 1
        elif is_first:
            step.row, step.anchor, step.t_ns, step.std = one.row, one.anchor, one.t_ns, math.sqrt(one.S)
            step.way, step.lasts = one.innovation, False
            count += 1
        row.last_ns[slot] = one.t_ns
    return count


@njit(nogil=True)
def _makes_step(row: Any, slot: int, one: Any) -> bool:
    """Add a range to those of its anchor. Return whether they have just made a step."""
    if one.p_outlier <= OUTLIER:
        row.clean_s[slot] += min((one.t_ns - row.last_ns[slot]) * 1e-9, LONGEST_S)
        row.run[slot] = 0
        return False
    if row.run[slot] == 0:
        row.run_ns[slot], row.sum[slot], row.before_s[slot] = one.t_ns, 0.0, row.clean_s[slot]
    row.run[slot] += 1
    row.sum[slot] += one.innovation
    row.clean_s[slot] = 0.0
    since_ns = one.t_ns - row.run_ns[slot]
    if row.before_s[slot] >= CLEAN_S and row.run[slot] >= STEP_RANGES and since_ns >= STEP_NS:
        row.before_s[slot] = _TOLD
        return True
    if row.before_s[slot] == _TOLD and row.run[slot] >= LONG_RANGES and since_ns >= LONG_NS:
        row.before_s[slot] = 0.0
        return True
    return False
