"""What one site has for zones, events and destinations."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from dropanchor_schemas.destinations import Destination
from dropanchor_service.delivery.channels import Channels
from dropanchor_service.delivery.registry import open_destinations
from dropanchor_service.events.database import Database
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.events.store import EventStore
from dropanchor_service.settings.events import DeliverySettings, EmailSettings, MqttSettings
from dropanchor_service.store.items import NamedItems
from dropanchor_service.zones.items import ZoneItems


@dataclass(frozen=True)
class EventParts:
    """problem_of: returns what went wrong at the last attempt of a destination."""

    items: ZoneItems
    store: EventStore
    destinations: NamedItems[Destination]
    deliveries: Deliveries
    channels: Channels
    problem_of: Callable[[str], str | None]

    @classmethod
    def in_memory(cls, site: str) -> Self:
        """Return parts that store nothing on disk and deliver nothing."""
        database = Database(None)
        return cls(
            ZoneItems.opened(None),
            EventStore(database, site),
            open_destinations(None),
            Deliveries(database),
            Channels(DeliverySettings(), EmailSettings(), MqttSettings()),
            lambda _: None,
        )
