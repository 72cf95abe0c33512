"""Publishes what the programs of tags should apply, whenever it changes."""

import zenoh

from dropanchor_schemas import keys
from dropanchor_service.answers.answers import to_json
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.store import SiteStore
from dropanchor_service.zenoh_io.periodic import PeriodicPublisher

PERIOD_S = 0.2


class ZenohRemoteSettings(PeriodicPublisher):
    """Publishes changes while it is open. A program that was away asks for its settings itself."""

    def __init__(self, session: zenoh.Session, site: SiteStore, metrics: Metrics) -> None:
        super().__init__("remote settings", PERIOD_S, metrics)
        self._session = session
        self._site = site
        self._published = site.document.remote

    def publish(self) -> None:
        """Put the settings of each tag for which they have changed."""
        before, self._published = self._published, self._site.document.remote
        if before is self._published:
            return
        for tag, settings in self._published.items():
            if settings != before.get(tag):
                key = keys.settings_key(self._site.site.id, tag)
                self._session.put(key, to_json(settings.model_dump()), encoding=zenoh.Encoding.APPLICATION_JSON)
