"""One line per event, and never a flood of them."""

import logging
import sys
import time
from collections.abc import Callable

REPEAT_S = 10.0


def configure(level: str = "INFO") -> None:
    handler = logging.StreamHandler(sys.stderr)
    formatter = logging.Formatter("%(asctime)s.%(msecs)03dZ %(levelname)s %(name)s: %(message)s", "%Y-%m-%dT%H:%M:%S")
    formatter.converter = time.gmtime
    handler.setFormatter(formatter)
    logging.basicConfig(level=level, handlers=[handler], force=True)
    logging.getLogger("uvicorn").setLevel(logging.WARNING)  # its start and stop are not events of ours


class RareLog:
    """Logs an event of one kind at most every ten seconds, and then how many were left out."""

    def __init__(self, logger: logging.Logger, clock: Callable[[], float] = time.monotonic) -> None:
        self._logger = logger
        self._clock = clock
        self._last: dict[str, float] = {}
        self._silent: dict[str, int] = {}

    def warning(self, kind: str, message: str) -> None:
        self._log(logging.WARNING, kind, message)

    def exception(self, kind: str, error: BaseException) -> None:
        """With the traceback the first time, in one line later."""
        first = kind not in self._last
        self._log(logging.ERROR, kind, f"{type(error).__name__}: {error}", error if first else None)

    def _log(self, level: int, kind: str, message: str, error: BaseException | None = None) -> None:
        now = self._clock()
        if now - self._last.get(kind, -REPEAT_S) < REPEAT_S:
            self._silent[kind] = self._silent.get(kind, 0) + 1
            return
        self._last[kind] = now
        left_out = self._silent.pop(kind, 0)
        more = f" (and {left_out} more like it)" if left_out else ""
        self._logger.log(level, "%s: %s%s", kind, message, more, exc_info=error)
