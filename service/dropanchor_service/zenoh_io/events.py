"""Publishes the events of all sites over Zenoh as soon as they are stored."""

from collections.abc import Sequence

import orjson
import zenoh

from dropanchor_schemas.keys import event_key
from dropanchor_service.events.store import EventStore
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.may_serve import MayServe, always
from dropanchor_service.zenoh_io.periodic import PeriodicPublisher

PERIOD_S = 0.1  # between two looks at the stores
AT_ONCE = 1000


class ZenohEvents(PeriodicPublisher):
    """Publishes while it is open, in the order of the events of each site. It begins with the next event."""

    def __init__(
        self, session: zenoh.Session, stores: Sequence[EventStore], metrics: Metrics, may_publish: MayServe = always
    ) -> None:
        super().__init__("zenoh events", PERIOD_S, metrics, may_publish)
        self._session = session
        self._stores = stores
        for store in stores:
            store.on_commit.append(self.wake)
        self._published = [store.newest for store in stores]

    def publish(self) -> None:
        """Put the events that have been stored since the last call."""
        for index, store in enumerate(self._stores):
            if store.newest > self._published[index]:
                self._publish(index, store)

    def _publish(self, index: int, store: EventStore) -> None:
        while store.newest > self._published[index] and not self._stop.is_set():
            for event in store.after(self._published[index], AT_ONCE):
                key = event_key(store.site, orjson.loads(event.body)["subject"])
                self._session.put(key, event.body, encoding=zenoh.Encoding.APPLICATION_JSON)
                self._published[index] = event.sequence
