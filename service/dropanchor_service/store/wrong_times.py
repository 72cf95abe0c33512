"""Times that tags send as UTC although they cannot be."""

import logging
from collections.abc import Iterator
from typing import NamedTuple

from dropanchor_schemas.sentences import say
from dropanchor_schemas.times import unit_of, why_not_utc

FRESH_NS = 10_000_000_000
MAX_LOGGED = 64

_UNITS = {
    "seconds": say("seconds", "seconds"),
    "milliseconds": say("milliseconds", "milliseconds"),
    "microseconds": say("microseconds", "microseconds"),
}

_log = logging.getLogger(__name__)


class _WrongTime(NamedTuple):
    sent_ns: int
    arrival_ns: int


class WrongTimes:
    """Keeps the last such time of each tag. The ingest thread writes; any thread reads."""

    def __init__(self) -> None:
        self._by_row: dict[int, _WrongTime] = {}
        self._logged: set[int] = set()

    def record(self, row: int, tag: str, sent_ns: int, arrival_ns: int) -> None:
        """Record a time of a tag. Log the first one of each tag, up to a limit."""
        self._by_row[row] = _WrongTime(sent_ns, arrival_ns)
        if row not in self._logged and len(self._logged) < MAX_LOGGED:
            self._logged.add(row)
            _log.warning("tag %s: %s. These samples are not used", tag, why_not_utc(sent_ns))

    def of(self, row: int, now_ns: int) -> int | None:
        """Return the wrong time that this tag sent recently, or None."""
        last = self._by_row.get(row)
        return None if last is None or now_ns - last.arrival_ns > FRESH_NS else last.sent_ns

    def fresh(self, now_ns: int) -> Iterator[tuple[int, int]]:
        """Yield row and time for every tag that sent one recently."""
        for row, last in list(self._by_row.items()):
            if now_ns - last.arrival_ns <= FRESH_NS:
                yield row, last.sent_ns


def hint_about_time(sent_ns: int) -> str:
    """Return what a person can do about a tag that sends such times."""
    unit = unit_of(sent_ns)
    if unit is not None:
        return say(
            "time_in_unit",
            "Its times (`t_ns`) look like {unit}, not nanoseconds: multiply them by {factor}, or say clock boot "
            "(flag bit 0) if they count from boot.",
            unit=_UNITS[unit.name],
            factor=unit.ns,
        )
    return say(
        "time_since_start",
        "Its times (`t_ns`) count from a start, such as boot, not from 1970: say clock boot (flag bit 0), or set its "
        "clock.",
    )
