"""Anchors that tags hear and the site does not have."""

import logging
from collections.abc import Iterator
from typing import NamedTuple

from dropanchor_schemas.keys import chunk_from_id

FRESH_NS = 10_000_000_000
MOST_LOGGED = 64

_log = logging.getLogger(__name__)


class _Heard(NamedTuple):
    number: int
    name: str
    t_ns: int


class UnknownAnchors:
    """One anchor for each row of a tag at most. Written by the ingest thread, read by any."""

    def __init__(self) -> None:
        self._of_row: dict[int, _Heard] = {}
        self._logged: set[int] = set()

    def note(self, row: int, tag: str, number: int, name: str, t_ns: int) -> None:
        """Remember that a tag was heard with a range to this anchor. Log each anchor once, and a bounded number of
        them. A tag that hears several keeps the first, so that what is shown does not flicker."""
        known = self._of_row.get(row)
        if known is None or known.number == number or t_ns - known.t_ns > FRESH_NS:
            self._of_row[row] = _Heard(number, name, t_ns)
        if number not in self._logged and len(self._logged) <= MOST_LOGGED:
            self._logged.add(number)
            self._log_first(tag, name)

    def of(self, row: int, now_ns: int) -> tuple[int, str] | None:
        """Number and id of the anchor that this tag has heard of late."""
        heard = self._of_row.get(row)
        return None if heard is None or now_ns - heard.t_ns > FRESH_NS else (heard.number, heard.name)

    def fresh(self, now_ns: int) -> Iterator[tuple[int, int, str]]:
        """Row, and number and id of the anchor, of every tag that has heard one of late."""
        for row, heard in list(self._of_row.items()):
            if now_ns - heard.t_ns <= FRESH_NS:
                yield row, heard.number, heard.name

    def _log_first(self, tag: str, name: str) -> None:
        if len(self._logged) > MOST_LOGGED:
            _log.warning("more than %d unknown anchors were heard: no more of them are named here", MOST_LOGGED)
            return
        _log.warning(
            "tag %s hears anchor %s, which this site does not have: its ranges are not used. If the anchor belongs to "
            "the site, add it: PUT /api/v1/anchors/%s; else set the right anchor in the tag",
            tag,
            name,
            chunk_from_id(name),
        )


def hint_about(name: str) -> str:
    """What a person can do about an anchor that a tag hears and the site does not have."""
    return f"Hears anchor {name}, which this site does not have: check its id, or add the anchor to the site."
