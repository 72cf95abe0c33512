"""The destinations: which of them an event goes to, and what may be saved."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import orjson

from dropanchor_schemas.destinations import Destination, EmailDestination, EventDestination, MqttPosesDestination
from dropanchor_schemas.sentences import say
from dropanchor_service.events.drafts import Draft
from dropanchor_service.runtime.atomic_file import write_atomically
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.store.items import PRIVATE, NamedItems, adapter_of

MAX_DESTINATIONS = 20
FILE_NAME = "destinations.json"
WEBHOOKS_FILE_NAME = "webhooks.json"  # of services that knew no other destinations
NO_DESTINATIONS = say("no_destinations", "there are no destinations")


def open_destinations(folder: Path | None, recovery: Recovery | None = None) -> NamedItems[Destination]:
    """Load the file, which only the service's user may read: it holds the secrets.

    recovery: reports a file that is damaged. Raises OSError and NewerFileError.
    """
    recovery = recovery or Recovery()
    path = None if folder is None else folder / FILE_NAME
    if path is not None and not path.exists():
        _take_over(path.with_name(WEBHOOKS_FILE_NAME), path, recovery)
    return NamedItems(adapter_of(Destination), path, MAX_DESTINATIONS, PRIVATE, recovery)


def addressees(destinations: NamedItems[Destination], draft: Draft) -> Sequence[str]:
    """Return the ids of the destinations that want the event."""
    found = destinations.all.values()
    return [one.id for one in found if not isinstance(one, MqttPosesDestination) and _wants(one, draft)]


def _take_over(webhooks: Path, path: Path, recovery: Recovery) -> None:
    """Make destinations of the webhooks in an older file, if there is one."""
    found = recovery.read_alone(webhooks, adapter_of(dict[str, Any]).validate_json, NO_DESTINATIONS)
    if found:
        destinations = {name: {**webhook, "type": "webhook"} for name, webhook in found.items()}
        write_atomically(path, [orjson.dumps(destinations)], PRIVATE)


def _wants(destination: EventDestination, draft: Draft) -> bool:
    data = draft.data  # who got an event learns that it is not true, or what became of its alarm
    types = {draft.type, data.get("retracted_type"), data.get("alarm_type")}
    return (
        destination.enabled
        and not (draft.is_muted and isinstance(destination, EmailDestination))
        and (not destination.types or not types.isdisjoint(destination.types))
        and (not destination.zones or draft.zone in destination.zones)
        and (not destination.tags or draft.tag in destination.tags or draft.data.get("other_tag") in destination.tags)
    )
