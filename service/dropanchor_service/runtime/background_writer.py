"""Write queued items in a background thread, so that neither a slow nor a full disk blocks the caller."""

import logging
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.runtime.worker import Worker

RETRY_S = 1.0
STOP_S = 2.0
STUCK_S = 10.0

Item = TypeVar("Item")
Write = Callable[[Sequence[Item]], None]


class BackgroundWriter(Worker, Generic[Item]):
    """A bounded queue that passes its items to `write` every `period_s`, even when it is empty, and on `wake`.

    When `write` raises OSError or sqlite3.Error, the same items are tried again every second until it succeeds.
    Meanwhile the queue fills; items that do not fit are dropped and counted. Any other error is a bug, and its items
    are dropped.
    """

    def __init__(
        self, name: str, write: Write[Item], period_s: float, max_bytes: int, waits_for: str = "the disk"
    ) -> None:
        """waits_for: what `write` waits for, for sentences."""
        super().__init__(name, STOP_S)
        self._log = RareLog(logging.getLogger(f"{__name__}.{name}"))
        self._name, self._waits_for = name, waits_for
        self._write = write
        self._period_s = period_s
        self._max_bytes = max_bytes
        self._lock = threading.Lock()
        self._queue: deque[tuple[Item, int, int]] = deque()  # item, size, count
        self.queued_bytes = 0
        self.dropped = 0
        self.errors = 0
        self._problem: str | None = None
        self._began_s: float | None = None  # while `write` runs

    @property
    def problem(self) -> str | None:
        """Why nothing can be written now: the last error, or a write that does not return."""
        began_s = self._began_s
        if began_s is not None and time.monotonic() - began_s > STUCK_S:
            return f"{self._name} cannot be written: {self._waits_for} has not answered for more than {STUCK_S:.0f} s"
        return self._problem

    def put(self, item: Item, size: int, count: int = 1) -> None:
        """Queue an item; any thread may call this.

        size: in bytes. count: by how much `dropped` grows when the item does not fit.
        """
        with self._lock:
            if self.queued_bytes + size > self._max_bytes:
                self.dropped += count
                return
            self._queue.append((item, size, count))
            self.queued_bytes += size
        if self.queued_bytes > self._max_bytes // 2:
            self.wake()

    def _run(self) -> None:
        while not self._stop.is_set():
            self._news.wait(self._period_s)
            self._news.clear()
            if not self.flush():
                self._stop.wait(RETRY_S)
        self.flush()

    def flush(self) -> bool:
        """Write all queued items. Return False when that must be tried again.

        The thread calls this; without the thread, its owner may.
        """
        count = len(self._queue)
        taken = [self._queue[index] for index in range(count)]
        self._began_s = time.monotonic()
        try:
            self._write([item for item, _, _ in taken])
        except (OSError, sqlite3.Error) as error:
            self._record_error(error)
            self._log.warning(self._name, f"cannot be written: {error}. The items are queued and tried again")
            return False
        except Exception as error:
            self._record_error(error)
            self._log.exception(self._name, error)
            self.dropped += sum(entry[2] for entry in taken)
        else:
            self._problem = None
        finally:
            self._began_s = None
        with self._lock:
            for _ in range(count):
                self.queued_bytes -= self._queue.popleft()[1]
        return True

    def _record_error(self, error: Exception) -> None:
        self.errors += 1
        self._problem = f"{self._name} cannot be written: {error}"
