"""Publishes what the programs of tags should apply, whenever it changes."""

import logging
import threading
from types import TracebackType
from typing import Self

import zenoh

from dropanchor_schemas import keys
from dropanchor_service.answers.answers import to_json
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.store import SiteStore

PERIOD_S = 0.2


class ZenohRemoteSettings:
    """Publishes changes from its own thread while it is open. A program that was away asks for its settings itself."""

    def __init__(self, session: zenoh.Session, site: SiteStore, metrics: Metrics) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._session = session
        self._site = site
        self._metrics = metrics
        self._published = site.document.remote
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="remote settings", daemon=True)

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
                self._put_changes()
            except Exception as error:
                self._metrics.faults.labels("publication").inc()
                self._log.exception("publication", error)

    def _put_changes(self) -> None:
        before, self._published = self._published, self._site.document.remote
        if before is self._published:
            return
        for tag, settings in self._published.items():
            if settings != before.get(tag):
                key = keys.settings_key(self._site.site.id, tag)
                self._session.put(key, to_json(settings.model_dump()), encoding=zenoh.Encoding.APPLICATION_JSON)
