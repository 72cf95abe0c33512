"""Writes what others put down, in a thread of its own: whoever puts never waits, and a full disk stops nobody."""

import logging
import sqlite3
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

from dropanchor_service.runtime.logs import RareLog

RETRY_S = 1.0

Item = TypeVar("Item")
Write = Callable[[Sequence[Item]], None]


class BackgroundWriter(Generic[Item]):
    """A bounded queue in front of `write`, which is called every `period_s` with all that waits, or with nothing.

    When `write` cannot (OSError, sqlite3.Error), the same items are offered to it again after a second, as often as
    it takes; meanwhile the queue fills, and what does not fit is dropped and counted. Any other error is one of ours:
    it costs the items that were to be written.
    """

    def __init__(self, name: str, write: Write[Item], period_s: float, most_bytes: int) -> None:
        self._log = RareLog(logging.getLogger(f"{__name__}.{name}"))
        self._name = name
        self._write = write
        self._period_s = period_s
        self._most_bytes = most_bytes
        self._lock = threading.Lock()
        self._waiting: deque[tuple[Item, int, int]] = deque()
        self._bytes = 0
        self._stop = threading.Event()
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self.dropped = 0
        self.errors = 0
        self.problem: str | None = None

    def start(self) -> None:
        self._thread.start()

    def stop(self, timeout_s: float = 2.0) -> None:
        """What waits is written once more."""
        self._stop.set()
        self._wake.set()
        self._thread.join(timeout_s)

    @property
    def is_alive(self) -> bool:
        return self._thread.is_alive()

    @property
    def waiting_bytes(self) -> int:
        return self._bytes

    def put(self, item: Item, size: int, count: int = 1) -> None:
        """From any thread. size: in bytes; count: of the things in it that are counted when it is dropped."""
        with self._lock:
            if self._bytes + size > self._most_bytes:
                self.dropped += count
                return
            self._waiting.append((item, size, count))
            self._bytes += size
        if self._bytes > self._most_bytes // 2:
            self._wake.set()

    def _run(self) -> None:
        while not self._stop.is_set():
            self._wake.wait(self._period_s)
            self._wake.clear()
            if not self.turn():
                self._stop.wait(RETRY_S)
        self.turn()

    def turn(self) -> bool:
        """Write all that waits; False when it has to be tried again. Called by the thread, or instead of it."""
        count = len(self._waiting)
        taken = [self._waiting[index] for index in range(count)]
        try:
            self._write([item for item, _, _ in taken])
        except (OSError, sqlite3.Error) as error:
            self._fail(error)
            self._log.warning(self._name, f"cannot be written: {error}")
            return False
        except Exception as error:
            self._fail(error)
            self._log.exception(self._name, error)
            self.dropped += sum(entry[2] for entry in taken)
        else:
            self.problem = None
        with self._lock:
            for _ in range(count):
                self._bytes -= self._waiting.popleft()[1]
        return True

    def _fail(self, error: Exception) -> None:
        self.errors += 1
        self.problem = f"{self._name} cannot be written: {error}"
