"""Decawave TREK1000 and EVK1000, and modules with four or eight anchors that print the same lines.

`mc` is a corrected range report, `mr` the same one before correction, `ma` the ranges between anchors:

    mc 0f 00000663 000005a3 00000512 000004cb 095f c1 00024c24 a0:0

mask, one range in mm per anchor, two counters, a time, and `a` or `t` (who reports) with tag and anchor. The clones end
the line with a diagnosis, write a mask that means nothing, and mark a missing range with ffffffff.
"""

import re

from dropanchor_tag_client.sources.modules.lines import Lines
from dropanchor_tag_client.sources.modules.report import Drop, Dropped, Range, Report, plausible

_REPORT = re.compile(
    r"m([acr])\s+([0-9a-f]{2})\s+((?:[0-9a-f]{8}\s+){4}(?:(?:[0-9a-f]{8}\s+){4})?)"
    r"[0-9a-f]{4}\s+[0-9a-f]{2}\s+[0-9a-f]{1,8}\s+[at](\d{1,3}):\d{1,3}(\s+[0-9a-f]{4,8})?"
)
_NO_RANGE = (0, 0xFFFFFFFF)
_MIN_UNCORRECTED = 3  # `mr` lines in sequence, until a module counts as one that prints no `mc` lines


class Trek1000:
    """Parse the ranges of the tag that each line names. An anchor is named by its place in the line, 0 to 7.

    `mr` lines are used only while no `mc` lines come: a module that prints both has measured only once.
    """

    def __init__(self) -> None:
        self.dropped = Dropped()
        self._lines = Lines(self.dropped)
        self._uncorrected = 0

    def feed(self, data: bytes) -> list[Report]:
        return [report for line in self._lines.feed(data) if (report := self._report(line)) is not None]

    def _report(self, line: str) -> Report | None:
        found = _REPORT.fullmatch(line)
        if found is None:
            if line.startswith(("mc ", "mr ", "ma ")):
                self.dropped[Drop.DAMAGED] += 1
            else:
                self.dropped.not_understood(line)
            return None
        kind, mask, ranges, tag, diagnosis = found.groups()
        if reason := self._reason_to_drop(kind):
            self.dropped[reason] += 1
            return None
        valid = int(mask, 16) if diagnosis is None else 0xFF
        return Report(self._ranges([int(text, 16) for text in ranges.split()], valid, str(int(tag))))

    def _reason_to_drop(self, kind: str) -> Drop | None:
        if kind == "a":
            return Drop.ANCHOR_TO_ANCHOR
        self._uncorrected = self._uncorrected + 1 if kind == "r" else 0
        return Drop.UNCORRECTED if 0 < self._uncorrected <= _MIN_UNCORRECTED else None

    def _ranges(self, millimetres: list[int], valid: int, tag: str) -> tuple[Range, ...]:
        return tuple(
            Range(anchor, value / 1000, tag)
            for anchor, value in enumerate(millimetres)
            if valid >> anchor & 1 and value not in _NO_RANGE and plausible(value / 1000, self.dropped)
        )
