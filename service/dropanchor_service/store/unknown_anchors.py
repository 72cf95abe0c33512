"""Anchors that tags range to although the site does not have them."""

import logging
from collections.abc import Iterator
from typing import NamedTuple

from dropanchor_schemas.keys import chunk_from_id
from dropanchor_schemas.sentences import say

FRESH_NS = 10_000_000_000
MAX_LOGGED = 64

_log = logging.getLogger(__name__)


class _Sighting(NamedTuple):
    number: int
    name: str
    t_ns: int


class UnknownAnchors:
    """Keeps at most one anchor per tag. The ingest thread writes; any thread reads.

    path: where REST has the site.
    """

    def __init__(self, path: str = "/api/v1") -> None:
        self._path = path
        self._by_row: dict[int, _Sighting] = {}
        self._logged: set[int] = set()

    def record(self, row: int, tag: str, number: int, name: str, t_ns: int) -> None:
        """Record that a tag sent a range to this anchor. Log each anchor once, up to a limit.

        A tag that ranges to several unknown anchors keeps the first, so that its hint does not flicker.
        """
        known = self._by_row.get(row)
        if known is None or known.number == number or t_ns - known.t_ns > FRESH_NS:
            self._by_row[row] = _Sighting(number, name, t_ns)
        if number not in self._logged and len(self._logged) <= MAX_LOGGED:
            self._logged.add(number)
            self._log_first(tag, name)

    def of(self, row: int, now_ns: int) -> tuple[int, str] | None:
        """Return the number and id of the unknown anchor that this tag ranged to recently, or None."""
        last = self._by_row.get(row)
        return None if last is None or now_ns - last.t_ns > FRESH_NS else (last.number, last.name)

    def fresh(self, now_ns: int) -> Iterator[tuple[int, int, str]]:
        """Yield row, anchor number and anchor id for every tag that recently ranged to an unknown anchor."""
        for row, last in list(self._by_row.items()):
            if now_ns - last.t_ns <= FRESH_NS:
                yield row, last.number, last.name

    def _log_first(self, tag: str, name: str) -> None:
        if len(self._logged) > MAX_LOGGED:
            _log.warning(
                "tags range to more than %d unknown anchors: further ones are not logged. Check the anchor ids",
                MAX_LOGGED,
            )
            return
        _log.warning(
            "tag %s hears anchor %s, which this site does not have: these ranges are not used. If the anchor belongs "
            "to the site, add it with PUT %s/anchors/%s. Otherwise set the right anchor in the tag",
            tag,
            name,
            self._path,
            chunk_from_id(name),
        )


def hint_about(name: str, hears_others: bool) -> str:
    """Return what an operator can do about an unknown anchor that a tag ranges to.

    hears_others: whether the tag ranges to anchors of the site, too.
    """
    if hears_others:
        return say(
            "hears_unknown",
            "Hears anchor {anchor}, which this site does not have: check its id, or add the anchor to the site.",
            anchor=name,
        )
    return say(
        "hears_only_unknown",
        "No anchor that it hears is part of this site: check the id of anchor {anchor}, or add it to the site.",
        anchor=name,
    )
