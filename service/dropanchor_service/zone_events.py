"""Zones, events and webhooks, as the settings want them."""

import sqlite3
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Self

from pydantic import ValidationError

from dropanchor_service.api.routes.event_parts import EventParts
from dropanchor_service.events.database import Database
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.events.store import EventStore
from dropanchor_service.events.thread import EventThread, Retention
from dropanchor_service.events.watcher import Fleet, Watcher
from dropanchor_service.metrics.events import EventMetrics
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.settings.events import WebhookSettings
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.store import HealthTable, LatestPoses, SiteStore, TagTable
from dropanchor_service.webhooks.queue import Patience
from dropanchor_service.webhooks.registry import addressees, open_webhooks
from dropanchor_service.webhooks.sender import Sender
from dropanchor_service.webhooks.thread import WebhookThread
from dropanchor_service.zones.items import ZoneItems


class ZoneEvents:
    """Watches and delivers while this context is open. Without a data folder, a restart forgets everything."""

    def __init__(
        self,
        settings: Settings,
        site: SiteStore,
        tags: TagTable,
        latest: LatestPoses,
        health: HealthTable,
        now_ns: Callable[[], int],
        metrics: Metrics,
    ) -> None:
        """Raises SettingsError when a file in the data folder cannot be read."""
        self._opened = ExitStack()
        folder = settings.data_dir
        try:
            items, webhooks = ZoneItems.opened(folder), open_webhooks(folder)
            self._database = Database(folder)
            self.store = EventStore(self._database, site.site.id, partial(addressees, webhooks))
            states = self.store.states()
        except (OSError, ValidationError, sqlite3.Error) as error:
            raise SettingsError(f"data_dir: zones or events in {folder} cannot be read: {error}") from error
        deliveries, sender = Deliveries(self._database), _sender(settings.webhooks)
        patience = Patience(settings.webhooks.retry_s, round(settings.webhooks.give_up_hours * 3600e9))
        self._webhooks = WebhookThread(webhooks, deliveries, sender, patience, now_ns)
        self._events = EventThread(
            Watcher(Fleet(site, tags, latest, health, now_ns), items, states),
            self.store,
            Retention(round(settings.events.keep_days * 86_400e9), int(settings.events.most_mib * 2**20)),
            now_ns,
            settings.events.period_ms * 1e-3,
        )
        self.parts = EventParts(items, self.store, webhooks, deliveries, sender, self._webhooks.problem_of)
        metrics.register(EventMetrics(self._events, self.store, deliveries, self._webhooks))

    def __enter__(self) -> Self:
        self._opened.callback(self._database.close)
        self._opened.enter_context(self._webhooks)
        self._opened.enter_context(self._events)
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def problems(self) -> Sequence[str]:
        """Return why events cannot be stored; empty when they can."""
        return [] if self._events.problem is None else [self._events.problem]


def _sender(settings: WebhookSettings) -> Sender:
    try:
        return Sender(settings.timeout_s, settings.allow_networks, settings.authorities)
    except OSError as error:
        raise SettingsError(f"webhooks.authorities: {settings.authorities} cannot be read: {error}") from error
