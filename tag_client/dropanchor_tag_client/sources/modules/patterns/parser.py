"""Parse the lines of a module by patterns."""

import re
from collections.abc import Iterable
from typing import Protocol

from dropanchor_tag_client.sources.modules.lines import Lines
from dropanchor_tag_client.sources.modules.patterns.fields import Field, PatternError
from dropanchor_tag_client.sources.modules.patterns.json_lines import PREFIX, JsonPattern
from dropanchor_tag_client.sources.modules.patterns.measured import Found, report
from dropanchor_tag_client.sources.modules.patterns.text import TextPattern
from dropanchor_tag_client.sources.modules.report import Drop, Dropped, Report

_COLOURS = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")  # of shells and logs


class Pattern(Protocol):
    """fields: by their names. found: what stands in them, for each measurement; None for another line."""

    fields: dict[str, Field]

    def found(self, line: str) -> list[Found] | None: ...


def pattern(text: str) -> Pattern:
    """Return the pattern that a text describes. Raises PatternError."""
    if not text.strip():
        raise PatternError("the pattern is empty", text, 0)
    return JsonPattern(text) if text.lstrip().startswith(PREFIX) else TextPattern(text)


class Patterns:
    """Parse lines by the first pattern that fits.

    ignored: how lines begin that are known to hold no measurement. is_repeating: whether the module prints its last
    measurement again until there is another one; a line that is equal to the one before then measures nothing.
    """

    def __init__(self, patterns: Iterable[Pattern], ignored: Iterable[str] = (), *, is_repeating: bool = False) -> None:
        self.dropped = Dropped()
        self._lines = Lines(self.dropped)
        self._patterns = tuple(patterns)
        self._ignored = tuple(ignored)
        self._is_repeating, self._last = is_repeating, ""

    def feed(self, data: bytes) -> list[Report]:
        return [one for line in self._lines.feed(data) if (one := self._report(_COLOURS.sub("", line))) is not None]

    def _report(self, line: str) -> Report | None:
        for candidate in self._patterns:
            if (found := candidate.found(line)) is not None:
                repeated = self._is_repeating and line == self._last
                self._last = line
                if not repeated:
                    return report(candidate.fields, found, self.dropped)
                self.dropped[Drop.REPEATED] += 1
                return Report(())
        if line.startswith(self._ignored):
            self.dropped[Drop.WITHOUT_RANGE] += 1
        else:
            self.dropped.not_understood(line)
        return None
