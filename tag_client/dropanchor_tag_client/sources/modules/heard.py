"""What arrived at a port lately, for a sentence about it when nothing of it was understood."""

import re
import shlex

from dropanchor_tag_client.sources.modules.foreign import foreign_to_uwb

_KEPT_BYTES = 4096
_SHOWN = 120
_LINE_END = re.compile(rb"[\r\n]+")
_NOT_TEXT = re.compile(rb"[^\t\r\n\x1b -~]")
_NOTHING = (
    "--pattern describes a line that holds a range or the axes of an IMU; any script can read the port and pipe into "
    "`publish`."
)
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

    @property
    def clarity(self) -> tuple[bool, bool, int]:
        """The greater, the more likely is the baud rate the right one."""
        return self.foreign is not None, self.is_text and self.count > 0, self.count

    @property
    def foreign(self) -> str | None:
        """What prints this, if it is known and no UWB module."""
        return foreign_to_uwb(self.last)

    def sentence(self, baud: int) -> str:
        """Return what arrived at this baud rate, and what to do about it."""
        if self.foreign is not None:
            return f"it looks like {self.foreign}."
        if not self.is_text:
            shown = visible(self.last[:_SHOWN].decode("latin-1"))
            return (
                f'no text: "{shown}". Another --baud than {baud} may be right, or the module speaks a binary protocol.'
            )
        *ended, rest = _LINE_END.split(self.last)
        lines = [text for one in ended if (text := one.decode("latin-1").strip())]
        if not lines:
            return f'no end of a line: "{visible(rest.decode("latin-1"))}". A measurement has to be a line of its own.'
        # 1 MB, which a module that is understood does not need
        from dropanchor_tag_client.sources.modules.patterns.suggest import suggestion
        from dropanchor_tag_client.sources.modules.recognise import likeness

        if (known := likeness(self.last)) is not None:
            return f'"{visible(lines[-1])}". {known}'
        if (found := suggestion(lines)) is not None:
            words = f"--pattern {shlex.quote(found.pattern)}{found.warning}"
            return f'"{visible(found.line)}". If it holds {found.holds}, try: {words}'
        return f'"{visible(lines[-1])}". {_NOTHING}'


def visible(text: str) -> str:
    """Return a text that a terminal can show, cut at a length."""
    shown = text.encode("unicode_escape").decode()
    return shown if len(shown) <= _SHOWN else f"{shown[:_SHOWN]}…"
