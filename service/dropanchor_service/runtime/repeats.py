"""A log handler that writes a repeated line once, and then how often it was repeated."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TextIO

WINDOW_S = 60.0
LINES = 20  # of a kind in a window, which differ in their values only, such as names of tags
KINDS = 1000  # that are remembered; more are written without being counted


@dataclass
class _Kind:
    """Lines with the same template. texts: written in this window."""

    began_s: float
    record: logging.LogRecord
    texts: set[str]
    repeated: int = 0


class CountingHandler(logging.StreamHandler[TextIO]):
    """Writes the first lines of each kind, and once a minute how many more there were.

    Lines are of a kind if they have the logger, the level, the template and the type of the error in common. Of those
    with the same text only the first is written, of those with other values LINES.
    """

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(stream)
        self._clock = clock
        self._kinds: dict[object, _Kind] = {}
        self._timer: threading.Timer | None = None

    def emit(self, record: logging.LogRecord) -> None:
        """Write the line, or count it. The caller holds the lock of the handler."""
        self._write_counts(self._clock() - WINDOW_S)
        error = record.exc_info[0] if record.exc_info else None
        key = (record.name, record.levelno, record.msg, error)
        kind = self._kinds.get(key)
        if kind is None:
            kind = _Kind(self._clock(), record, set())
            if len(self._kinds) < KINDS:
                self._kinds[key] = kind
        text = record.getMessage()
        if text in kind.texts or len(kind.texts) >= LINES:
            kind.repeated += 1
            self._write_later()
            return
        kind.texts.add(text)
        super().emit(record)

    def close(self) -> None:
        """Write what was counted so far."""
        with self._locked():
            if self._timer is not None:
                self._timer.cancel()
            self._write_counts(self._clock())
        super().close()

    def _locked(self) -> threading.RLock:
        assert self.lock is not None
        return self.lock

    def _write_later(self) -> None:
        """Write the counts at the end of the window, even if nothing else is logged."""
        if self._timer is None:
            self._timer = threading.Timer(WINDOW_S, self._on_time)
            self._timer.daemon = True
            self._timer.start()

    def _on_time(self) -> None:
        with self._locked():
            self._timer = None
            self._write_counts(self._clock() - WINDOW_S)
            if any(kind.repeated for kind in self._kinds.values()):
                self._write_later()

    def _write_counts(self, until_s: float) -> None:
        """Write how often the lines of each window that began by then were repeated, and forget it."""
        for key, kind in [entry for entry in self._kinds.items() if entry[1].began_s <= until_s]:
            del self._kinds[key]
            if kind.repeated:
                super().emit(_repeated(kind))


def _repeated(kind: _Kind) -> logging.LogRecord:
    first = kind.record
    text = f"repeated {kind.repeated:,} times in the last minute: {first.getMessage()}"
    return logging.LogRecord(first.name, first.levelno, first.pathname, first.lineno, text, None, None)
