"""The thread that watches, stores events and deletes old ones."""

import logging
import sqlite3
import time
from collections.abc import Callable
from dataclasses import dataclass

from dropanchor_service.events.store import EventStore
from dropanchor_service.events.watcher import Watcher
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.runtime.worker import Worker

MAX_UNSAVED = 50_000  # events that wait for the disk; then nothing is judged until they are stored
RETRY_S = 1.0
PRUNE_S = 60.0
MAX_PRUNE_S = 0.5
STOP_S = 5.0


@dataclass(frozen=True)
class Retention:
    """Which events are kept."""

    keep_ns: int
    max_bytes: int


class EventThread(Worker):
    """Watches while this context is open. An event is shown to nobody before it is stored."""

    def __init__(
        self, watcher: Watcher, store: EventStore, retention: Retention, now_ns: Callable[[], int], period_s: float
    ) -> None:
        super().__init__("events", STOP_S)
        self._log = RareLog(logging.getLogger(__name__))
        self._watcher = watcher
        self._store = store
        self._retention = retention
        self._now_ns = now_ns
        self._period_s = period_s
        self._prune_due_s = 0.0
        self.problem: str | None = None
        self.stored = 0
        self.busy_s = 0.0
        """Time that the thread has worked."""

    def _run(self) -> None:
        while not self._stop.wait(self._period_s if self.problem is None else RETRY_S):
            began_s = time.thread_time()
            self.turn()
            self.busy_s += time.thread_time() - began_s

    def turn(self) -> None:
        """Watch and store once. The thread calls this; without the thread, its owner may."""
        if len(self._watcher.drafts) < MAX_UNSAVED:
            self._watcher.turn()
        try:
            self._save()
            self._prune()
        except sqlite3.Error as error:
            self.problem = f"events cannot be stored: {error}"
            self._log.warning("events", f"cannot be stored: {error}. Make room on the disk; they wait until then")
        else:
            self.problem = None
        if self._watcher.is_full:
            self._log.warning("too close", "a rule has too many pairs to follow: give it fewer tags or less distance")

    def _save(self) -> None:
        drafts, states, stays = self._watcher.drafts, self._watcher.states, self._watcher.stays
        if drafts or states:
            self._store.commit(drafts, states, stays)
            self._watcher.drafts, self._watcher.states, self._watcher.stays = [], {}, []
            self.stored += len(drafts)

    def _prune(self) -> None:
        if time.monotonic() < self._prune_due_s:
            return
        end_s = time.monotonic() + MAX_PRUNE_S
        keep_from_ns = self._now_ns() - self._retention.keep_ns
        while self._store.prune(keep_from_ns, self._retention.max_bytes) and time.monotonic() < end_s:
            pass
        self._prune_due_s = time.monotonic() + PRUNE_S
