"""Makerfabs MaUWB (ESP32 with DW3000 and the AT firmware), after `AT+SETRPT=1`.

    AT+RANGE=tid:1,mask:04,seq:63,range:(0,0,30,0,0,0,0,0),rssi:(0.00,0.00,-77.93,…)

Ranges are in cm, 0 where there is none. Later firmware names the anchor of each place: `ancid:(0,-1,…)`.
"""

import re

from dropanchor_tag_client.sources.modules.lines import Lines
from dropanchor_tag_client.sources.modules.report import Drop, Dropped, Range, Report, plausible

_START = "AT+RANGE="
_REPORT = re.compile(
    r"tid:\s*(\d{1,5}),\s*mask:\s*([0-9A-Fa-f]{1,4}),\s*seq:\s*\d{1,5},\s*range:\s*\(([-\d, ]+)\)"
    r"(?:,\s*rssi:\s*\([-\d., ]*\))?(?:,\s*ancid:\s*\(([-\d, ]+)\))?"
)
_INTEGER = re.compile(r"-?\d{1,6}")
_MAX_PLACES = 16


class Makerfabs:
    """Parse the ranges of the tag that each line names. An anchor is named by its number."""

    def __init__(self) -> None:
        self.dropped = Dropped()
        self._lines = Lines(self.dropped)

    def feed(self, data: bytes) -> list[Report]:
        return [report for line in self._lines.feed(data) if (report := self._report(line)) is not None]

    def _report(self, line: str) -> Report | None:
        before, start, text = line.rpartition(_START)
        if not start:
            self.dropped.not_understood(line)
            return None
        self.dropped[Drop.DAMAGED] += _START in before
        found = _REPORT.fullmatch(text)
        ranges = _integers(found[3]) if found else None
        anchors = _integers(found[4]) if found and found[4] else list(range(_MAX_PLACES))
        if found is None or ranges is None or anchors is None or not len(ranges) <= len(anchors):
            self.dropped[Drop.DAMAGED] += 1
            return None
        mask, tag = int(found[2], 16), str(int(found[1]))
        return Report(
            tuple(
                Range(anchor, centimetres / 100, tag)
                for place, (anchor, centimetres) in enumerate(zip(anchors, ranges, strict=False))
                if mask >> place & 1 and anchor >= 0 and centimetres and plausible(centimetres / 100, self.dropped)
            )
        )


def _integers(text: str) -> list[int] | None:
    parts = [part.strip() for part in text.split(",")]
    whole = len(parts) <= _MAX_PLACES and all(_INTEGER.fullmatch(part) for part in parts)
    return [int(part) for part in parts] if whole else None
