"""Zones, events and their delivery, as the settings want them."""

import sqlite3
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Self

from dropanchor_service.api.routes.event_parts import EventParts
from dropanchor_service.delivery.channels import Channels
from dropanchor_service.delivery.queue import Patience
from dropanchor_service.delivery.registry import addressees, open_destinations
from dropanchor_service.delivery.thread import DeliveryThread
from dropanchor_service.events.database import Database
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.events.store import EventStore
from dropanchor_service.events.thread import EventThread, Retention
from dropanchor_service.events.watcher import Fleet, Watcher
from dropanchor_service.metrics.events import EventMetrics
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.store import HealthTable, LatestPoses, SiteStore, TagTable
from dropanchor_service.store.shared import Shared
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
            items, destinations = ZoneItems.opened(folder), open_destinations(folder)
            self._database = Database(folder)
            self.store = EventStore(self._database, site.site.id, partial(addressees, destinations))
            states = self.store.states()
        except (OSError, ValueError, sqlite3.Error) as error:
            raise SettingsError(f"data_dir: zones or events in {folder} cannot be read: {error}") from error
        deliveries, channels = Deliveries(self._database), _channels(settings, site)
        patience = Patience(settings.delivery.retry_s, round(settings.delivery.give_up_hours * 3600e9))
        self._delivery = DeliveryThread(destinations, deliveries, channels, patience, now_ns)
        self._events = EventThread(
            Watcher(Fleet(site, tags, latest, health, now_ns), items, states),
            self.store,
            Retention(round(settings.events.keep_days * 86_400e9), int(settings.events.most_mib * 2**20)),
            now_ns,
            settings.events.period_ms * 1e-3,
        )
        self.parts = EventParts(items, self.store, destinations, deliveries, channels, self._delivery.problem_of)
        metrics.register(EventMetrics(self._events, self.store, deliveries, self._delivery, now_ns))

    def __enter__(self) -> Self:
        self._opened.callback(self._database.close)
        self._opened.enter_context(self._delivery)
        self._opened.enter_context(self._events)
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    @property
    def shared(self) -> Mapping[str, Shared]:
        """What people change, by the names of its files."""
        items = self.parts.items
        return {
            "zones.json": items.zones,
            "event_rules.json": items.rules,
            "destinations.json": self.parts.destinations,
        }

    def problems(self) -> Sequence[str]:
        """Return why events cannot be stored; empty when they can."""
        return [] if self._events.problem is None else [self._events.problem]


def _channels(settings: Settings, site: SiteStore) -> Channels:
    """Return the ways to destinations. Raises SettingsError."""

    def name_of(tag: str) -> str:
        name = site.tag_settings(tag).name
        return f"{name} ({tag})" if name else tag

    delivery = settings.delivery
    try:
        return Channels(delivery, settings.email, settings.mqtt, name_of)
    except OSError as error:
        raise SettingsError(f"delivery.authorities: {delivery.authorities} cannot be read: {error}") from error
