"""What the routes of one site work on."""

from dataclasses import dataclass, field

from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.routes.event_parts import EventParts
from dropanchor_service.phones.intake import Receive
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.recording.recorder import Recorder


@dataclass(frozen=True)
class SiteParts:
    """receive, receive_health: take samples and health that come over HTTP. recorder: None without a folder for files.

    events: zones, events and destinations; None where there are no routes of them. plans: floor plans. max_tags: how
    many tags the site admits.
    """

    answers: Answers
    receive: Receive
    receive_health: Receive
    plans: PlanStore = field(default_factory=lambda: PlanStore(None))
    events: EventParts | None = None
    recorder: Recorder | None = None
    max_tags: int = 20_000

    @property
    def zone_events(self) -> EventParts:
        """The zones, events and destinations of a site that has routes of them."""
        assert self.events is not None
        return self.events

    @property
    def id(self) -> str:
        return self.answers.site.site.id
