"""Times of a column as ns: their unit, wrapped counters, ISO 8601."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.importing.readings import LATEST_NS, NS_PER_S, TIME
from dropanchor_service.importing.tables.table import Exact
from dropanchor_service.importing.tables.units import conversion
from dropanchor_tag_client.recording.units import interval_of

UTC_S = (1e9, 4.1e9)  # from 2001 to 2099: numbers within are taken for UTC
_USUAL_HZ = 50.0
_PLAUSIBLE_HZ = (0.2, 20_000.0)
_UNITS = ("s", "ms", "us", "ns")
_WRAP = 2**32
DAY_NS = 86_400 * NS_PER_S
_HALF_OF_DAY = re.compile(r"(.*?)(0?[1-9]|1[0-2])(:\d{2}\S*?)\s*([ap])\.?m\.?(.*)", re.IGNORECASE)
_OF_DAY = re.compile(r"\s*\d{1,2}:\d{2}(:\d{2}|\s*$)")


class Times(NamedTuple):
    """t_ns: (n,) int64. notes: what was decided."""

    t_ns: Array
    notes: list[str]


def times_of(raw: Sequence[Exact], unit: str | None, column: str, lines: list[int]) -> Times:
    """Return the times of a column. unit: None if nobody told; one that cannot be is not used. lines: of the rows."""
    notes = []
    numbers, wraps = _unwrapped(raw)
    if wraps:
        notes.append(f"{column}: the counter wraps at 2^32 (line {lines[wraps[0]]}): unwrapped {len(wraps)} times")
    if unit is not None and np.median(np.abs(np.asarray(numbers, np.float64))) * _factor(unit) >= LATEST_NS:
        notes.append(f"{column}: the values are after 2116 in {unit}")
        unit = None
    if unit is None:
        unit = _unit_of(np.asarray(numbers, np.float64))
        notes.append(f"{column}: no unit is told; the values look like {_NAMES[unit]}: --map t={column}:{unit}")
    return Times(np.array([bounded(number, _factor(unit)) for number in numbers], np.int64), notes)


_NAMES = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}


def iso_ns(text: str) -> tuple[int, bool] | None:
    """Return the time of a text in ISO 8601 and whether it names its time zone; None if it is none.

    A time without a zone is taken for UTC, and a time of day for that of the first day of 1970. Hours may be those of
    AM and PM.
    """
    if half := _HALF_OF_DAY.fullmatch(text):
        day, hour, rest, which, zone = half.groups()
        text = f"{day}{int(hour) % 12 + 12 * (which in 'pP'):02}{rest}{zone}"
    if _OF_DAY.match(text):
        text = f"1970-01-01T{'0' if text.strip()[1] == ':' else ''}{text.strip()}"
    if len(text) < 10 or text[4:5] not in "-0123456789" or not ("-" in text[1:] or "T" in text):
        return None
    whole, point, rest = text.strip().replace(",", ".").partition(".")
    digits = rest[: len(rest) - len(rest.lstrip("0123456789"))] if point else ""
    try:
        moment = datetime.fromisoformat((whole + rest[len(digits) :]).replace(" ", "T", 1))
    except ValueError:
        return None
    has_zone = moment.tzinfo is not None
    if not has_zone:
        moment = moment.replace(tzinfo=UTC)
    seconds = round((moment.replace(microsecond=0)).timestamp())
    return seconds * NS_PER_S + int((digits + "0" * 9)[:9]), has_zone


def past_midnight(times_ns: Sequence[Exact]) -> tuple[list[Exact], int] | None:
    """Return times of day that go on behind midnight, ns, and how often it was midnight; None for times with a date."""
    if max(times_ns) >= DAY_NS:
        return None
    t_ns = np.asarray(times_ns, np.int64)
    days = np.concatenate([[0], np.cumsum(np.diff(t_ns) < -DAY_NS // 2)])
    return (t_ns + days * DAY_NS).tolist(), int(days[-1])


def _unwrapped(raw: Sequence[Exact]) -> tuple[Sequence[Exact], list[int]]:
    """Return the numbers without the wraps of a 32-bit counter, and the rows at which it wrapped."""
    if not raw or max(raw) >= _WRAP or max(raw) < _WRAP // 2 or not all(isinstance(number, int) for number in raw):
        return raw, []
    steps = np.diff(np.asarray(raw, np.int64))
    wraps = (np.flatnonzero(steps < -_WRAP // 2) + 1).tolist()
    if not wraps:
        return raw, []
    added = np.zeros(len(raw), np.int64)
    added[wraps] = _WRAP
    return (np.asarray(raw, np.int64) + np.cumsum(added)).tolist(), wraps


def _unit_of(numbers: Array) -> str:
    """Return the unit in which the numbers are dates of this century at a plausible rate, or else the rate is usual."""
    if len(numbers) < 2 and np.all(numbers < UTC_S[0]):
        return "s"
    steps = np.diff(numbers)
    rising = steps[steps > 0]
    step = interval_of(numbers.tolist()) or (float(np.median(rising)) if len(rising) else 1.0)
    middle = float(np.median(numbers))
    rates = {unit: NS_PER_S / (step * _factor(unit)) for unit in _UNITS}
    for unit, rate in rates.items():
        seconds = middle * _factor(unit) / NS_PER_S
        if UTC_S[0] <= seconds < UTC_S[1] and (_PLAUSIBLE_HZ[0] <= rate <= _PLAUSIBLE_HZ[1] or len(numbers) < 3):
            return unit
    return min(_UNITS, key=lambda unit: abs(float(np.log(rates[unit] / _USUAL_HZ))))


def bounded(number: Exact, factor: float = 1.0) -> int:
    """Return ns, exactly for a number that is exact; of nonsense the latest time that there is."""
    is_exact = factor == int(factor) and not isinstance(number, float)
    ns = number * int(factor) if is_exact else float(number) * factor
    return round(min(max(ns, -LATEST_NS), LATEST_NS))


def _factor(unit: str) -> float:
    return conversion(unit, TIME).factor
