"""Zones, events and their delivery, of all sites, as the settings want them."""

import sqlite3
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import NamedTuple, Self
from urllib.parse import quote

from dropanchor_service.answers.answers import Answers
from dropanchor_service.delivery.channels import Channels, SharedWays
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.delivery.live_site import LiveSite
from dropanchor_service.delivery.queue import Patience
from dropanchor_service.delivery.receiver_networks import ReceiverNetworks, open_networks
from dropanchor_service.delivery.registry import addressees, open_destinations
from dropanchor_service.delivery.thread import DeliveryThread, Outbox
from dropanchor_service.events.alarms import open_alarms
from dropanchor_service.events.database import Database
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.events.site_watch import WatchedSite
from dropanchor_service.events.store import EventStore
from dropanchor_service.events.thread import EventThread, Retention
from dropanchor_service.events.trail import ChangeTrail
from dropanchor_service.events.watcher import Watcher
from dropanchor_service.metrics.events import EventMetrics
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.persistence.site import settings_of
from dropanchor_service.runtime.recovery import NewerFileError, Recovery
from dropanchor_service.settings.events import DeliverySettings
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.store import LatestPoses, ServedSite, Sites, SiteStore
from dropanchor_service.store.shared import Shared
from dropanchor_service.zones.items import ZoneItems


class _Opened(NamedTuple):
    """What one site has stored."""

    items: ZoneItems
    outbox: Outbox
    watched: WatchedSite


class ZoneEvents:
    """Watches and delivers while this context is open. Without a data folder, a restart forgets everything.

    One thread watches all sites, and one delivers for all. parts: of each site, in the order of their indices.
    """

    def __init__(
        self,
        settings: Settings,
        sites: Sites,
        latest: LatestPoses,
        now_ns: Callable[[], int],
        metrics: Metrics,
        recovery: Recovery | None = None,
    ) -> None:
        """recovery: reports files that are damaged. Raises SettingsError when one is of a later version."""
        self._recovery = recovery or Recovery()
        self._closing = ExitStack()
        self._sites = sites
        self._now_ns = now_ns
        shared = _shared_ways(settings)
        opened = [self._open(settings, site, latest, shared, several=len(sites) > 1) for site in sites]
        outboxes = [one.outbox for one in opened]
        self.stores = [outbox.store for outbox in outboxes]
        patience = Patience(settings.delivery.retry_s, round(settings.delivery.give_up_hours * 3600e9))
        self._delivery = DeliveryThread(outboxes, patience, now_ns)
        self._events = EventThread(
            Watcher([one.watched for one in opened], latest, now_ns),
            self.stores,
            Retention(round(settings.events.keep_days * 86_400e9), int(settings.events.max_mib * 2**20)),
            now_ns,
            settings.events.period_ms * 1e-3,
        )
        self.parts = [self._parts(index, one) for index, one in enumerate(opened)]
        metrics.register(EventMetrics(self._events, outboxes, self._delivery, now_ns))

    def _parts(self, index: int, of_site: _Opened) -> EventParts:
        outbox = of_site.outbox
        problem_of = partial(self._delivery.problem_of, index)
        return EventParts(
            *(of_site.items, outbox.store, outbox.destinations, outbox.deliveries, outbox.channels, problem_of),
            ChangeTrail(outbox.store.database, self._now_ns),
        )

    def _open(
        self, settings: Settings, site: ServedSite, latest: LatestPoses, shared: SharedWays, several: bool
    ) -> _Opened:
        folder = settings_of(settings, site.id).data_dir
        try:
            items, destinations = ZoneItems.opened(folder, self._recovery), open_destinations(folder, self._recovery)
            networks = ReceiverNetworks(settings.delivery.allow_networks, open_networks(folder, self._recovery))
            database = Database(folder, self._recovery)
            self._closing.callback(database.close)
            store = EventStore(database, site.id, partial(addressees, destinations))
            stored = store.states(), store.starts(), open_alarms(database)
            watched = WatchedSite(site.store, site.tags, site.health, items, *stored)
        except NewerFileError as error:
            raise SettingsError(f"data_dir: {error}") from error
        except (OSError, ValueError, sqlite3.Error) as error:
            raise SettingsError(f"data_dir: zones or events in {folder} cannot be read: {error}") from error
        delivery = _with_page_of(settings.delivery, site.id) if several else settings.delivery
        of_site = partial(_name_of, site.store), shared, networks, lambda: site.store.site.time_zone
        channels = Channels(delivery, settings.email, settings.mqtt, *of_site)
        live = LiveSite(Answers(site.store, site.tags, latest, self._now_ns), items.zones, store)
        return _Opened(items, Outbox(destinations, store, Deliveries(database), channels, live), watched)

    def __enter__(self) -> Self:
        self._closing.enter_context(self._delivery)
        self._closing.enter_context(self._events)
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.close()

    @property
    def shared(self) -> Mapping[str, Shared]:
        """What people change, by the names of its files."""
        return {
            f"{site.id}/{name}": items
            for site, parts in zip(self._sites, self.parts, strict=True)
            for name, items in (
                ("zones.json", parts.items.zones),
                ("event_rules.json", parts.items.rules),
                ("destinations.json", parts.destinations),
                ("receiver_networks.json", parts.channels.networks.items),
            )
        }

    def problems(self) -> Sequence[str]:
        """Return why events cannot be stored, with several sites for each; empty when they can."""
        found = sorted(self._events.problems.items())
        if len(self._sites) == 1:
            return [problem for _, problem in found]
        return [f"site {self._sites[index].id}: {problem}" for index, problem in found]


def _shared_ways(settings: Settings) -> SharedWays:
    """Return what the sites share. Raises SettingsError."""
    authorities = settings.delivery.authorities
    try:
        return SharedWays(authorities)
    except OSError as error:
        raise SettingsError(f"delivery.authorities: {authorities} cannot be read: {error}") from error


def _with_page_of(delivery: DeliverySettings, site: str) -> DeliverySettings:
    """Return the settings with the address of the page of one of several sites."""
    if delivery.page is None:
        return delivery
    separator = "&" if "?" in delivery.page else "?"
    return delivery.model_copy(update={"page": f"{delivery.page}{separator}site={quote(site, safe='')}"})


def _name_of(site: SiteStore, tag: str) -> str:
    name = site.tag_settings(tag).name
    return f"{name} ({tag})" if name else tag
