"""Decawave DWM1001 with PANS: the shell commands `lec` and `les`.

At high rates the firmware writes one line into another. A line counts only if all of it is in order: the
number of anchors that it announces, each with its index, a hexadecimal id and numbers of two decimals.
"""

import re

from dropanchor_tag_client.sources.modules.lines import Lines
from dropanchor_tag_client.sources.modules.report import Drop, Dropped, Range, Report, plausible

_NUMBER = r"-?\d{1,7}\.\d{2}"
_ID = r"[0-9A-F]{4}"
_DIST = re.compile(r"DIST,(\d{1,2})(?:,(.*))?")
_LEC_ANCHOR = re.compile(rf"AN(\d{{1,2}}),({_ID}),{_NUMBER},{_NUMBER},{_NUMBER},({_NUMBER})(?:,|$)")
_LEC_END = re.compile(rf"(?:POS,{_NUMBER},{_NUMBER},{_NUMBER},\d{{1,3}})?")
_LES_ANCHOR = re.compile(rf"({_ID})\[{_NUMBER},{_NUMBER},{_NUMBER}\]=({_NUMBER})(?: |$)")
_LES_END = re.compile(rf"(?:le_us=\d+ ?)?(?:est\[{_NUMBER},{_NUMBER},{_NUMBER},\d{{1,3}}\])?")
_LES_START = re.compile(rf"{_ID}\[")
_PROMPT = "dwm>"

_Anchors = list[tuple[str, float]]


class Dwm1001:
    """Parse the ranges of a tag to its anchors, which are named as the module prints them (`022E`)."""

    def __init__(self) -> None:
        self.dropped = Dropped()
        self._lines = Lines(self.dropped)

    def feed(self, data: bytes) -> list[Report]:
        return [report for line in self._lines.feed(data) if (report := self._report(line)) is not None]

    def _report(self, line: str) -> Report | None:
        text = line.removeprefix(_PROMPT).strip()
        if "DIST," in text:
            anchors = _lec(text[text.rindex("DIST,") :])
        elif start := _LES_START.search(text):
            anchors = _les(text[start.start() :])
        else:
            if text.startswith("POS,"):
                self.dropped[Drop.POSITION_ONLY] += 1
            elif text:
                self.dropped.not_understood(line)
            return None
        if anchors is None or len({name for name, _ in anchors}) != len(anchors):
            self.dropped[Drop.DAMAGED] += 1
            return None
        return Report(tuple(Range(name, range_m) for name, range_m in anchors if plausible(range_m, self.dropped)))


def _lec(text: str) -> _Anchors | None:
    """Return the anchors of `DIST,n,AN0,id,x,y,z,range,…`; None if the line is damaged."""
    head = _DIST.fullmatch(text)
    if head is None:
        return None
    rest, anchors = head[2] or "", _Anchors()
    while found := _LEC_ANCHOR.match(rest):
        if int(found[1]) != len(anchors):
            return None
        anchors.append((found[2], float(found[3])))
        rest = rest[found.end() :]
    return anchors if len(anchors) == int(head[1]) and _LEC_END.fullmatch(rest) else None


def _les(text: str) -> _Anchors | None:
    """Return the anchors of `id[x,y,z]=range … le_us=… est[…]`; None if the line is damaged."""
    rest, anchors = text, _Anchors()
    while found := _LES_ANCHOR.match(rest):
        anchors.append((found[1], float(found[2])))
        rest = rest[found.end() :]
    return anchors if anchors and _LES_END.fullmatch(rest) else None
