"""Split bytes into lines of text of limited length."""

import re

from dropanchor_tag_client.sources.modules.report import Drop, Dropped

MAX_LINE_BYTES = 1024
_END = re.compile(rb"[\r\n]+")


class Lines:
    """Collect bytes and return whole lines. A line of more than `MAX_LINE_BYTES` is dropped."""

    def __init__(self, dropped: Dropped) -> None:
        self._dropped = dropped
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[str]:
        *ended, self._rest = _END.split(self._rest + data)
        lines = [line for line in map(self._line, ended) if line]
        if len(self._rest) > MAX_LINE_BYTES:
            self._rest = b""
            self._skipping = True
        return lines

    def _line(self, line: bytes) -> str:
        """Return the text of a line, empty if the line is too long."""
        too_long = self._skipping or len(line) > MAX_LINE_BYTES
        self._skipping = False
        if too_long:
            self._dropped[Drop.TOO_LONG] += 1
            return ""
        return line.decode("latin-1").strip()
