"""Decide in which unit the times of a recording are: from the name of their column, and from how often a row comes."""

import itertools
from array import array
from collections.abc import Iterable, Sequence
from statistics import median
from typing import NamedTuple

from dropanchor_tag_client.recording.columns import TIMES
from dropanchor_tag_client.recording.recording import RecordingError
from dropanchor_tag_client.recording.table import Table

MIN_TIMES = 5  # fewer tell nothing about the interval
LATEST_S = 2.0**62 / 1e9  # the last time of the wire format, in 2116
_BLOCK = 20  # rows; samples may come in bursts


class Unit(NamedTuple):
    name: str
    per_second: float


UNITS = {
    "t_s": Unit("seconds", 1.0),
    "t_ms": Unit("milliseconds", 1e3),
    "t_us": Unit("microseconds", 1e6),
    "t_ns": Unit("nanoseconds", 1e9),
}
DW1000 = Unit("ticks of the DW1000", 128 * 499.2e6)  # Qorvo DW1000 user manual, 15.65 ps
DW1000_TICKS = 2.0**40


def settle_units(tables: Sequence[Table]) -> list[str]:
    """Turn all times into seconds. Return sentences on what the columns hold. Raises RecordingError.

    Tables whose columns of times have the same name share a unit, if one is plausible for all of them.
    """
    found: dict[tuple[str, str], list[str]] = {}
    for column in TIMES:
        named = [table for table in tables if table.time == column and len(table)]
        for table, unit in zip(named, _units_of(named, UNITS[column]), strict=True):
            if unit != UNITS[column]:
                found.setdefault((column, unit.name), []).append(table.rows.file)
            table.t = array("d", (t / unit.per_second for t in table.t))
    return [
        f"{', '.join(files)}: {column} holds {name}, as the intervals between the rows show; read as {name}"
        for (column, name), files in found.items()
    ]


def interval_of(t: Sequence[float]) -> float | None:
    """Return the median interval between rows with different times, None if there are too few."""
    different = [t[0], *(b for a, b in itertools.pairwise(t) if a != b)] if t else []
    if len(different) < MIN_TIMES:
        return None
    block = min(_BLOCK, len(different) - 1)
    intervals = [(b - a) / block for a, b in zip(different, different[block:], strict=False) if b > a]
    return median(intervals) if intervals else None


def _units_of(tables: Sequence[Table], declared: Unit) -> list[Unit]:
    plausible = [_plausible(table, declared) for table in tables]
    for unit in plausible[0] if plausible else ():
        if all(unit in units for units in plausible):
            return [unit] * len(tables)
    return [units[0] for units in plausible]


def _plausible(table: Table, declared: Unit) -> list[Unit]:
    """Return the plausible units of a table, the declared one first. Raises RecordingError if there are none."""
    usual = median(map(abs, table.t))  # single times may be nonsense
    units = [declared, *(unit for unit in UNITS.values() if unit != declared)]
    possible = [unit for unit in units if usual / unit.per_second < LATEST_S]
    if not possible:
        raise RecordingError(
            f"{table.path} {table.rows.unit} {table.rows.numbers[0]}: {table.time} is {table.t[0]:.10g}, which is "
            "after 2116 in any unit. Write the times in seconds"
        )
    interval = interval_of(table.t)
    if interval is None or table.file.interval_s is None:
        return possible
    low, high = table.file.interval_s
    fitting = [unit for unit in possible if low <= interval / unit.per_second <= high]
    if _wraps_like_a_dw1000(table.t, interval) and low <= interval / DW1000.per_second <= high:
        return [*_before(fitting, UNITS["t_ns"]), DW1000]
    if fitting:
        return fitting
    raise RecordingError(
        f"{table.path}: a step of {interval:.3g} in {table.time} is too "
        f"{'short' if interval < low * declared.per_second else 'long'} between {table.file.holds}, whether the times "
        "are seconds, milliseconds, microseconds or nanoseconds. Write them in seconds"
    )


def _before(units: Iterable[Unit], end: Unit) -> list[Unit]:
    return [unit for unit in units if unit != end]


def _wraps_like_a_dw1000(t: Sequence[float], interval: float) -> bool:
    """Return whether this may be a counter of 40 bits that begins again where it is full."""
    if min(t) < 0 or max(t) >= DW1000_TICKS:
        return False
    back = [b - a for a, b in itertools.pairwise(t) if b < a]
    return bool(back) and all(0 <= step + DW1000_TICKS <= 20 * interval for step in back)
