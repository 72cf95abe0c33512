"""The thread that watches, stores events and deletes old ones."""

import logging
import sqlite3
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from dropanchor_service.events.store import EventStore
from dropanchor_service.events.watcher import Watcher
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.runtime.worker import Worker

RETRY_S = 1.0
RETRY_TURNS = 5  # between two attempts of a site whose events cannot be stored, while those of others can
MAX_SAVE_S = 0.5  # in one turn
PRUNE_S = 60.0
PRUNED_AT_ONCE = 10  # sites
MAX_PRUNE_S = 0.5
STOP_S = 5.0


@dataclass(frozen=True)
class Retention:
    """Which events are kept."""

    keep_ns: int
    max_bytes: int


class EventThread(Worker):
    """Watches all sites while this context is open. An event is shown to nobody before it is stored.

    It sleeps while nothing changes and no rule waits for a time to pass.

    problems: by the index of a site, why its events cannot be stored. stored: events, since the start. busy_s: time
    that the thread has worked.
    """

    def __init__(
        self,
        watcher: Watcher,
        stores: Sequence[EventStore],
        retention: Retention,
        now_ns: Callable[[], int],
        period_s: float,
    ) -> None:
        """stores: of each site, in the order of their indices."""
        super().__init__("events", STOP_S)
        self._log = RareLog(logging.getLogger(__name__))
        self._watcher = watcher
        self._stores = stores
        self._retention = retention
        self._now_ns = now_ns
        self._period_s = period_s
        watcher.on_news(self.wake)
        self._prune_due = deque((0.0, index) for index in range(len(stores)))
        self._turns = 0
        self.problems: dict[int, str] = {}
        self.stored = 0
        self.busy_s = 0.0

    def _run(self) -> None:
        while not self._stop.wait(self._period_s if len(self.problems) < len(self._stores) else RETRY_S):
            self._news.clear()
            began_s = time.thread_time()
            self.turn()
            self.busy_s += time.thread_time() - began_s
            if not self._watcher.needs_time:
                self._news.wait(max(0.0, self._prune_due[0][0] - time.monotonic()))

    def turn(self) -> None:
        """Watch and store once. The thread calls this; without the thread, its owner may."""
        self._turns += 1
        self._watcher.turn()
        self._save_changed()
        for index in self._due():
            if index not in self._watcher.changed:  # else its events could not be stored
                self._attempt(index, self._prune)
        if self._watcher.is_full:
            self._log.warning("too close", "a rule has too many pairs to follow: give it fewer tags or less distance")

    def _save_changed(self) -> None:
        """Store what has happened, the longest waiting site first, as far as there is time: each waits for the disk.

        A site whose events cannot be stored is tried again now and then only, so that it does not slow down the others.
        """
        end_s = time.monotonic() + MAX_SAVE_S
        tries_again = len(self._stores) == 1 or self._turns % RETRY_TURNS == 0
        for index in list(self._watcher.changed):
            if tries_again or index not in self.problems:
                self._attempt(index, self._save)
                if time.monotonic() > end_s or self._stop.is_set():
                    return

    def _attempt(self, index: int, work: Callable[[int], None]) -> None:
        try:
            work(index)
        except sqlite3.Error as error:
            self.problems[index] = f"events cannot be stored: {error}"
            site = self._stores[index].site
            text = f"of the site {site} cannot be stored: {error}. Make room on the disk; they wait until then"
            self._log.warning("events", text)
        else:
            self.problems.pop(index, None)

    def _save(self, index: int) -> None:
        site = self._watcher.sites[index]
        self.stored += self._stores[index].commit(site.happened, site.states, site.stays)
        site.happened, site.states, site.stays = [], {}, []
        self._watcher.changed.pop(index, None)

    def _due(self) -> Iterator[int]:
        """Yield the sites whose old events are to be deleted: each once in `PRUNE_S`, a few in one turn."""
        now_s = time.monotonic()
        for _ in range(PRUNED_AT_ONCE):
            if self._prune_due[0][0] > now_s:
                return
            _, index = self._prune_due.popleft()
            yield index
            self._prune_due.append((now_s + PRUNE_S, index))

    def _prune(self, index: int) -> None:
        end_s = time.monotonic() + MAX_PRUNE_S
        keep_from_ns = self._now_ns() - self._retention.keep_ns
        while self._stores[index].prune(keep_from_ns, self._retention.max_bytes) and time.monotonic() < end_s:
            pass
