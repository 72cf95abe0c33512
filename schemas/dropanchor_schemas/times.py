"""Times as programs and people write them: ISO 8601, and what a time that cannot be UTC in ns looks like.

This module needs only the standard library, because tags import it.
"""

import re
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

EARLIEST_UTC_NS = 1_420_070_400_000_000_000
"""2015: no tag has measured anything before. An earlier UTC is in another unit, or counts from another start."""

EXPECTED = "a time in ns, or as ISO 8601 with a time zone, such as 2026-01-31T09:30:00Z, was expected"
_NUMBER = re.compile(r"([+-]?\d+)(\.\d+)?", re.ASCII)
_ISO = re.compile(r"(\d{4}-\d\d-\d\dT\d\d:\d\d(?::\d\d)?)(?:[.,](\d{1,9}))?(Z|[+-]\d\d:?\d\d)", re.ASCII)
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_S = 1_000_000_000
_MAX_DIGITS = 30
_SECONDS = range(1_000_000_000, 4_000_000_000)  # since 1970, from 2001 to 2096


class Unit(NamedTuple):
    """A unit of time. ns: how many ns it has."""

    name: str
    ns: int


UNITS = (Unit("seconds", _S), Unit("milliseconds", 1_000_000), Unit("microseconds", 1_000))


def ns_of_iso(text: str) -> int:
    """Return the time of an ISO 8601 text, UTC in ns. Raises ValueError."""
    found = _ISO.fullmatch(text.upper())  # RFC 3339 allows t and z
    if found is None:
        raise ValueError(EXPECTED)
    whole, fraction, zone = found.groups()
    since = datetime.fromisoformat(whole + zone) - _EPOCH
    return since // timedelta(seconds=1) * _S + int((fraction or "").ljust(9, "0"))


def ns_of_parameter(text: str) -> int:
    """Return the time that a parameter asks for, UTC in ns. Raises ValueError, which says what to write instead.

    text: a number of ns, or ISO 8601. In a URL, a plus sign means a space.
    """
    number = _NUMBER.fullmatch(text)
    if number is None:
        return ns_of_iso(re.sub(r" (?=\d\d:?\d\d$)", "+", text))
    digits, fraction = number.groups()
    if len(digits) > _MAX_DIGITS:  # Python refuses to read very many
        raise ValueError("the time is out of range")
    t_ns = int(digits)
    unit = unit_of(t_ns)
    if unit is not None:
        meant = _iso(t_ns * unit.ns)
        raise ValueError(f"{text} looks like {unit.name}: write it in ns, times {unit.ns}, or as {meant}")
    if fraction:
        raise ValueError(EXPECTED)
    return t_ns


def unit_of(t_ns: int) -> Unit | None:
    """Return the unit in which a number looks like a UTC of our days, None if it looks like none of `UNITS`."""
    return next((unit for unit in UNITS if t_ns * unit.ns // _S in _SECONDS), None)


def why_not_utc(t_ns: int) -> str | None:
    """Return what a time is that cannot be UTC in ns, and what to do, without a full stop; None if it can be UTC."""
    return f"t_ns is {_iso(t_ns)}: {t_ns} {_looks(t_ns)}" if 0 <= t_ns < EARLIEST_UTC_NS else None


def _looks(t_ns: int) -> str:
    unit = unit_of(t_ns)
    if unit is not None:
        return (
            f"looks like {unit.name}; multiply it by {unit.ns}, or say clock boot (flag bit 0) if it counts from boot"
        )
    return "counts from a start, such as boot; say clock boot (flag bit 0), or set the clock"


def _iso(t_ns: int) -> str:
    return f"{_EPOCH + timedelta(microseconds=t_ns // 1000):%Y-%m-%dT%H:%M:%SZ}"
