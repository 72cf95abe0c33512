"""Publishes events over Zenoh as soon as they are stored."""

import orjson
import zenoh

from dropanchor_schemas.keys import event_key
from dropanchor_service.events.store import EventStore
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.may_serve import MayServe, always
from dropanchor_service.zenoh_io.periodic import PeriodicPublisher

PERIOD_S = 0.1
AT_ONCE = 1000


class ZenohEvents(PeriodicPublisher):
    """Publishes while it is open, in the order of the events. It begins with the next event."""

    def __init__(
        self, session: zenoh.Session, store: EventStore, metrics: Metrics, may_publish: MayServe = always
    ) -> None:
        super().__init__("zenoh events", PERIOD_S, metrics, may_publish)
        self._session = session
        self._store = store
        self._published = store.newest

    def publish(self) -> None:
        """Put the events that have been stored since the last call."""
        while self._store.newest > self._published and not self._stop.is_set():
            for event in self._store.after(self._published, AT_ONCE):
                key = event_key(self._store.site, orjson.loads(event.body)["subject"])
                self._session.put(key, event.body, encoding=zenoh.Encoding.APPLICATION_JSON)
                self._published = event.sequence
