"""Configure the log and limit the rate of repeated lines."""

import logging
import sys
import time
from collections.abc import Callable

from dropanchor_service.runtime.repeats import CountingHandler

REPEAT_S = 10.0


def configure(level: str = "INFO") -> None:
    """Log to standard error, with UTC times. A line that repeats is counted."""
    handler = CountingHandler(sys.stderr)
    formatter = logging.Formatter("%(asctime)s.%(msecs)03dZ %(levelname)s %(name)s: %(message)s", "%Y-%m-%dT%H:%M:%S")
    formatter.converter = time.gmtime
    handler.setFormatter(formatter)
    logging.basicConfig(level=level, handlers=[handler], force=True)
    logging.getLogger("httpx").setLevel(logging.WARNING)  # it logs whole URLs, and those of webhooks are secrets
    logging.getLogger("uvicorn").setLevel(logging.WARNING)  # its start and stop messages repeat ours


class RareLog:
    """Logs each kind of event at most every ten seconds, and then says how many it suppressed."""

    def __init__(self, logger: logging.Logger, clock: Callable[[], float] = time.monotonic) -> None:
        self._logger = logger
        self._clock = clock
        self._last: dict[str, float] = {}
        self._suppressed: dict[str, int] = {}

    def warning(self, kind: str, message: str) -> None:
        """Log a warning."""
        self._log(logging.WARNING, kind, message)

    def exception(self, kind: str, error: BaseException) -> None:
        """Log an error, with its traceback the first time and in one line afterwards."""
        first = kind not in self._last
        self._log(logging.ERROR, kind, f"{type(error).__name__}: {error}", error if first else None)

    def _log(self, level: int, kind: str, message: str, error: BaseException | None = None) -> None:
        now = self._clock()
        if now - self._last.get(kind, -REPEAT_S) < REPEAT_S:
            self._suppressed[kind] = self._suppressed.get(kind, 0) + 1
            return
        self._last[kind] = now
        suppressed = self._suppressed.pop(kind, 0)
        more = f" (and {suppressed} more like it)" if suppressed else ""
        self._logger.log(level, "%s: %s%s", kind, message, more, exc_info=error)
