"""A progress line on standard error."""

import sys
import time
from typing import TextIO


class Progress:
    """On a terminal, rewrite one line five times a second. Elsewhere, write a new line every ten seconds."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._terminal = self._stream.isatty()
        self._next_s = time.monotonic() + (0.0 if self._terminal else 10.0)
        self._shown = False

    def show(self, share: float, text: str) -> None:
        now_s = time.monotonic()
        if now_s < self._next_s:
            return
        self._next_s = now_s + (0.2 if self._terminal else 10.0)
        self._shown = True
        line = f"{share:4.0%}  {text}"
        self._stream.write(f"\r{line}\033[K" if self._terminal else f"{line}\n")
        self._stream.flush()

    def end(self) -> None:
        if self._shown and self._terminal:
            self._stream.write("\n")
            self._stream.flush()
