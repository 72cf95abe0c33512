"""Publishes events over Zenoh as soon as they are stored."""

import logging
import threading
from types import TracebackType
from typing import Self

import orjson
import zenoh

from dropanchor_schemas.keys import event_key
from dropanchor_service.events.store import EventStore
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog

PERIOD_S = 0.1
AT_ONCE = 1000


class ZenohEvents:
    """Publishes from its own thread while it is open, in the order of the events. It begins with the next event."""

    def __init__(self, session: zenoh.Session, store: EventStore, metrics: Metrics) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._session = session
        self._store = store
        self._metrics = metrics
        self._published = store.newest
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="zenoh events", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join(1.0)

    def _run(self) -> None:
        while not self._stop.wait(PERIOD_S):
            try:
                self._put_new()
            except Exception as error:
                self._metrics.faults.labels("publication").inc()
                self._log.exception("events", error)

    def _put_new(self) -> None:
        while self._store.newest > self._published and not self._stop.is_set():
            for event in self._store.after(self._published, AT_ONCE):
                key = event_key(self._store.site, orjson.loads(event.body)["subject"])
                self._session.put(key, event.body, encoding=zenoh.Encoding.APPLICATION_JSON)
                self._published = event.sequence
