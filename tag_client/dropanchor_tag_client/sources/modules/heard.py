"""What arrived at a port lately, for a sentence about it when nothing of it was understood."""

import re
import shlex

_KEPT_BYTES = 4096
_SHOWN = 120
_LINE_END = re.compile(rb"[\r\n]+")
_NOT_TEXT = re.compile(rb"[^\t\r\n\x1b -~]")
_MAX_NOT_TEXT = 0.2  # of the bytes of lines that a few damaged characters leave readable


class Heard:
    """The number of bytes since the last report, and the last of them."""

    def __init__(self) -> None:
        self.count = 0
        self.last = b""

    def add(self, data: bytes) -> None:
        self.count += len(data)
        self.last = (self.last + data)[-_KEPT_BYTES:]

    def clear(self) -> None:
        self.count, self.last = 0, b""

    @property
    def is_text(self) -> bool:
        return len(_NOT_TEXT.findall(self.last)) <= _MAX_NOT_TEXT * len(self.last)

    def sentence(self, baud: int) -> str:
        """Return what arrived at this baud rate, and what to do about it."""
        if not self.is_text:
            shown = visible(self.last[:_SHOWN].decode("latin-1"))
            return (
                f'no text: "{shown}". Another --baud than {baud} may be right, or the module speaks a binary protocol.'
            )
        *lines, rest = _LINE_END.split(self.last)
        line = next((one for one in reversed(lines) if one.strip()), b"").decode("latin-1").strip()
        if not line:
            return f'no end of a line: "{visible(rest.decode("latin-1"))}". A measurement has to be a line of its own.'
        return f'"{visible(line)}". {way_out(line)}'


def visible(text: str) -> str:
    """Return a text that a terminal can show, cut at a length."""
    shown = text.encode("unicode_escape").decode()
    return shown if len(shown) <= _SHOWN else f"{shown[:_SHOWN]}…"


def way_out(line: str) -> str:
    """Return how a line that no module prints can be read: by a pattern that fits it, if one suggests itself."""
    # 1 MB, which a module that is understood does not need
    from dropanchor_tag_client.sources.modules.patterns.parser import pattern
    from dropanchor_tag_client.sources.modules.patterns.suggest import suggestion

    suggested = suggestion(line)
    if suggested is not None and pattern(suggested).found(line):
        return f"If it holds a range, try: --pattern {shlex.quote(suggested)}"
    return "--pattern describes a line that holds a range; any script can read the port and pipe into `publish`."
