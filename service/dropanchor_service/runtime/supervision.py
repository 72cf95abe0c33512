"""Report threads that die of an error."""

import logging
import threading
from typing import Self

_log = logging.getLogger(__name__)


class Supervision:
    """Records every Python thread that ends with an error while this context manager is open.

    Zenoh's threads are not Python threads and are not covered.
    """

    def __init__(self) -> None:
        self.dead_threads: list[str] = []
        """Names of the threads that have ended with an error."""

    def __enter__(self) -> Self:
        self._before = threading.excepthook
        threading.excepthook = self._on_error
        return self

    def __exit__(self, *_: object) -> None:
        threading.excepthook = self._before

    def _on_error(self, died: threading.ExceptHookArgs) -> None:
        name = "unknown" if died.thread is None else died.thread.name
        self.dead_threads.append(name)
        _log.critical("the thread %s has died of an unexpected error: please report it", name, exc_info=died.exc_value)
