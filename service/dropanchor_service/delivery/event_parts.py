"""What one site has for zones, events and destinations."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from dropanchor_schemas.destinations import Destination
from dropanchor_service.delivery import write_only
from dropanchor_service.delivery.channels import Channels
from dropanchor_service.delivery.registry import open_destinations
from dropanchor_service.events.database import Database
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.events.store import EventStore
from dropanchor_service.events.trail import ChangeTrail
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.settings.events import DeliverySettings, EmailSettings, MqttSettings
from dropanchor_service.store import SiteStore
from dropanchor_service.store.items import NamedItems
from dropanchor_service.store.omlox_items import OmloxItems
from dropanchor_service.zones.items import ZoneItems


@dataclass(frozen=True)
class EventParts:
    """problem_of: returns what went wrong at the last attempt of a destination. trail: of all changes in the site."""

    items: ZoneItems
    store: EventStore
    destinations: NamedItems[Destination]
    deliveries: Deliveries
    channels: Channels
    problem_of: Callable[[str], str | None]
    trail: ChangeTrail

    def note_changes(self, site: SiteStore, plans: PlanStore, omlox: OmloxItems | None) -> None:
        """Note in the trail what changes here and in the other stores of the site."""
        site.trail = self.trail
        self.items.zones.note_changes(self.trail, "zone")
        self.items.rules.note_changes(self.trail, "rule")
        self.destinations.note_changes(self.trail, "destination", write_only.shown)
        self.channels.networks.items.note_changes(self.trail, "receiver-network")
        plans.note_changes(self.trail, "plan")
        if omlox is not None:
            omlox.trackables.note_changes(self.trail, "omlox-trackable")
            omlox.tag_trackables.note_changes(self.trail, "omlox-tag-trackable")
            omlox.providers.note_changes(self.trail, "omlox-provider")
            omlox.fences.note_changes(self.trail, "omlox-fence")

    @classmethod
    def in_memory(cls, site: str, now_ns: Callable[[], int] = time.time_ns) -> Self:
        """Return parts that store nothing on disk and deliver nothing."""
        database = Database(None)
        return cls(
            ZoneItems.opened(None),
            EventStore(database, site),
            open_destinations(None),
            Deliveries(database),
            Channels(DeliverySettings(), EmailSettings(), MqttSettings()),
            lambda _: None,
            ChangeTrail(database, now_ns),
        )
