"""What a site has now, for destinations of states rather than events."""

from typing import NamedTuple

from dropanchor_schemas.zones import Zone
from dropanchor_service.answers.answers import Answers
from dropanchor_service.events.store import EventStore
from dropanchor_service.store.items import NamedItems


class LiveSite(NamedTuple):
    """events: which tags are in which zone."""

    answers: Answers
    zones: NamedItems[Zone]
    events: EventStore
