"""Publishes what the programs of tags should apply, whenever it changes."""

from collections.abc import Mapping

import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.site import RemoteSettings
from dropanchor_service.answers.answers import to_json
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.may_serve import MayServe, always
from dropanchor_service.store import Sites
from dropanchor_service.zenoh_io.periodic import PeriodicPublisher

PERIOD_S = 0.2


class ZenohRemoteSettings(PeriodicPublisher):
    """Publishes changes while it is open. A program that was away asks for its settings itself."""

    def __init__(self, session: zenoh.Session, sites: Sites, metrics: Metrics, may_publish: MayServe = always) -> None:
        super().__init__("remote settings", PERIOD_S, metrics, may_publish)
        self._session = session
        self._stores = [site.store for site in sites]
        for store in self._stores:
            store.on_change.append(self.wake)
        self._published = [store.document.remote for store in self._stores]

    def publish(self) -> None:
        """Put the settings of each tag for which they have changed."""
        before, self._published = self._published, [store.document.remote for store in self._stores]
        for store, earlier, remote in zip(self._stores, before, self._published, strict=True):
            if earlier is not remote:
                self._put_changes(store.site.id, earlier, remote)

    def _put_changes(self, site: str, before: Mapping[str, RemoteSettings], now: Mapping[str, RemoteSettings]) -> None:
        for tag, settings in now.items():
            if settings != before.get(tag):
                key = keys.settings_key(site, tag)
                self._session.put(key, to_json(settings.model_dump()), encoding=zenoh.Encoding.APPLICATION_JSON)
