"""A served page with destinations that deliver, or whose deliveries are dead."""

import ipaddress
import time
from dataclasses import replace

from dropanchor_schemas.destinations import EmailDestination
from dropanchor_schemas.zones import EventType
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.delivery.channels import Channels
from dropanchor_service.delivery.registry import addressees
from dropanchor_service.events.database import Database
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.events.drafts import Draft
from dropanchor_service.events.store import EventStore
from dropanchor_service.settings.events import DeliverySettings, EmailSettings, MqttSettings
from service.dashboard.zone_place import ZonePlace, square, zone_place

SECRET = examples.SECRET


def alert_place(email: EmailSettings | None = None) -> ZonePlace:
    """Return a place with a zone that watches how long tags stay, and a mail server in its settings."""
    place = zone_place()
    email = email or EmailSettings(server="127.0.0.1", port=1, tls="none")
    delivery = DeliverySettings(allow_networks=(ipaddress.ip_network("127.0.0.0/8"),), timeout_s=60.0)
    destinations = place.parts.destinations
    store = EventStore(Database(None), "yard", lambda draft: addressees(destinations, draft))
    place.parts = replace(
        place.parts,
        channels=Channels(delivery, email, MqttSettings(server="127.0.0.1")),
        store=store,
        deliveries=Deliveries(store.database),
    )
    place.put(square("yard", 1.0, 1.0, name="Yard 10", dwell_s=300.0, speed_mps=2.0))
    return place


def put_mail(place: ZonePlace, name: str = "shift") -> None:
    place.parts.destinations.put(name, EmailDestination(type="email", id=name, to=["shift@example.com"]))


def happen(place: ZonePlace, *tags: str) -> None:
    now_ns = time.time_ns()
    data = {"t_ns": now_ns, "since_ns": now_ns, "zone": "yard", "name": "Yard 10"}
    place.parts.store.commit([Draft(EventType.ZONE_ENTER, tag, data) for tag in tags], {})
