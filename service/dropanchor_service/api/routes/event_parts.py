"""What the routes for zones, events and webhooks work on."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from dropanchor_schemas.webhooks import Webhook
from dropanchor_service.events.database import Database
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.events.store import EventStore
from dropanchor_service.store.items import NamedItems
from dropanchor_service.webhooks.registry import open_webhooks
from dropanchor_service.webhooks.sender import Sender
from dropanchor_service.zones.items import ZoneItems

TIMEOUT_S = 10.0


@dataclass(frozen=True)
class EventParts:
    """problem_of: returns why the last attempt of a webhook failed."""

    items: ZoneItems
    store: EventStore
    webhooks: NamedItems[Webhook]
    deliveries: Deliveries
    sender: Sender
    problem_of: Callable[[str], str | None]

    @classmethod
    def in_memory(cls, site: str) -> Self:
        """Return parts that store nothing on disk and deliver nothing."""
        database = Database(None)
        return cls(
            ZoneItems.opened(None),
            EventStore(database, site),
            open_webhooks(None),
            Deliveries(database),
            Sender(TIMEOUT_S, ()),
            lambda _: None,
        )
