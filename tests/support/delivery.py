"""Destinations of this process and the thread that delivers to them, without a service."""

import ipaddress
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dropanchor_schemas.destinations import Destination, WebhookDestination
from dropanchor_schemas.site import Site
from dropanchor_schemas.zones import EventType
from dropanchor_service.delivery.channels import Channels
from dropanchor_service.delivery.live_site import LiveSite
from dropanchor_service.delivery.queue import Patience
from dropanchor_service.delivery.registry import addressees, open_destinations
from dropanchor_service.delivery.sentences import NameOf
from dropanchor_service.delivery.thread import DeliveryThread, Outbox
from dropanchor_service.events.database import Database
from dropanchor_service.events.deliveries import Deliveries, QueueState
from dropanchor_service.events.drafts import Draft
from dropanchor_service.events.store import EventStore
from dropanchor_service.settings.events import DeliverySettings, EmailSettings, MqttSettings
from dropanchor_service.zones.items import ZoneItems
from support.api import make_api_bench
from support.receiver import Receiver

SECRET = "whsec_ZHJvcGFuY2hvci1leGFtcGxlLXNlY3JldC0wMQ=="
LOOPBACK = (ipaddress.ip_network("127.0.0.0/8"),)


class DeliveryBench:
    def __init__(
        self,
        give_up_s: float = 3600.0,
        second_chance_s: float = 3600.0,
        email: EmailSettings | None = None,
        mqtt: MqttSettings | None = None,
        folder: Path | None = None,
        name_of: NameOf = str,
        **delivery: Any,
    ) -> None:
        """folder: where everything is stored, None: nowhere. delivery: settings of `[delivery]`."""
        database = Database(folder)
        self.destinations = open_destinations(folder)
        self.store = EventStore(database, "yard", lambda draft: addressees(self.destinations, draft))
        self.deliveries = Deliveries(database)
        settings = DeliverySettings.model_validate({"allow_networks": LOOPBACK, "timeout_s": 60.0} | delivery)
        self.channels = Channels(
            settings, email or EmailSettings(), mqtt or MqttSettings(), name_of, zone_of=self._zone
        )
        patience = Patience(
            retry_s=0.2, give_up_ns=round(give_up_s * 1e9), second_chance_ns=round(second_chance_s * 1e9)
        )
        self.live = make_api_bench(Site(id="yard"))
        self.zones = ZoneItems.opened(None).zones
        live = LiveSite(self.live.answers, self.zones, self.store)
        outbox = self.outbox = Outbox(self.destinations, self.store, self.deliveries, self.channels, live)
        self.thread = DeliveryThread([outbox], patience, time.time_ns)

    def _zone(self) -> str | None:
        return self.live.answers.site.site.time_zone

    def put(self, destination: Destination) -> None:
        self.destinations.put(destination.id, destination)

    def hook(self, receiver: Receiver, name: str = "mes", **fields: Any) -> None:
        url = f"http://127.0.0.1:{receiver.port}/events"
        self.put(WebhookDestination(type="webhook", id=name, url=url, secret=SECRET, **fields))

    def happen(self, *tags: str) -> None:
        """Let these tags enter a zone, all at once."""
        now_ns = time.time_ns()
        data = {"t_ns": now_ns, "since_ns": now_ns, "zone": "dock", "name": "Loading dock", "x": 3.21, "y": 1.7}
        self.store.commit([Draft(EventType.ZONE_ENTER, tag, data | {"probability": 0.998}) for tag in tags], {})

    def counts(self, name: str = "mes") -> tuple[int, int]:
        """Return how many events wait and are dead."""
        return self.deliveries.states().get(name, QueueState())[:2]


def in_order(events: Sequence[dict[str, Any]]) -> bool:
    """Return whether the first arrivals of the events of every tag came in order."""
    by_tag: dict[str, list[str]] = defaultdict(list)
    for event in {event["id"]: event for event in reversed(events)}.values():
        by_tag[event["subject"]].insert(0, event["sequence"])
    return all(sequences == sorted(sequences) for sequences in by_tag.values())
