"""A thread that works from start to stop."""

import threading
from abc import ABC, abstractmethod
from typing import Self


class Worker(ABC):
    """Calls `_run` on a thread of its own, from `start` to `stop` or while this context is open.

    `_run` returns soon after the event `_stop` is set. It may sleep until `_news` is set, too, which `wake` does.
    """

    def __init__(self, name: str, stop_s: float = 1.0) -> None:
        """stop_s: how long `stop` waits for the thread at most."""
        self._stop = threading.Event()
        self._news = threading.Event()
        self._stop_s = stop_s
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @abstractmethod
    def _run(self) -> None:
        """Work until `_stop` is set."""

    def start(self) -> None:
        self._thread.start()

    def wake(self) -> None:
        """Tell the thread that there is something to do. Any thread may call this."""
        if not self._news.is_set():
            self._news.set()

    def stop(self) -> None:
        self._stop.set()
        self._news.set()
        self._thread.join(self._stop_s)

    @property
    def is_alive(self) -> bool:
        return self._thread.is_alive()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
