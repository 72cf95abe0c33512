"""No thread of ours dies silently."""

import logging
import threading
from types import TracebackType
from typing import Self

_log = logging.getLogger(__name__)


class Supervision:
    """While it is open it learns of every thread that ends with an error. (Those that Zenoh makes are not threads of
    Python's.)"""

    def __init__(self) -> None:
        self.dead: list[str] = []
        """Names of threads that have ended with an error."""

    def __enter__(self) -> Self:
        self._before = threading.excepthook
        threading.excepthook = self._on_error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        threading.excepthook = self._before

    def _on_error(self, died: threading.ExceptHookArgs) -> None:
        name = "unknown" if died.thread is None else died.thread.name
        self.dead.append(name)
        _log.critical("the thread %s has died", name, exc_info=died.exc_value)
