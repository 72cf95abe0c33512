"""What the routes of one site work on."""

from collections.abc import Callable
from dataclasses import dataclass

from dropanchor_schemas.wire import Reason
from dropanchor_service.answers.answers import Answers
from dropanchor_service.blackbox.box import BlackBox
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.phones.intake import Receive
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.store.omlox_items import OmloxItems


@dataclass(frozen=True)
class SiteParts:
    """receive, receive_health: take samples and health that come over HTTP. recorder: None without a folder for files.

    plans: floor plans. events: zones, events and destinations. max_tags: how many tags the site admits. omlox: what
    omlox clients have said; None for no omlox interface. refusal_of: returns why the site refuses all samples of a tag.
    box: the black box of all sites, None without one.
    """

    answers: Answers
    receive: Receive
    receive_health: Receive
    plans: PlanStore
    events: EventParts
    recorder: Recorder | None = None
    max_tags: int = 20_000
    omlox: OmloxItems | None = None
    box: BlackBox | None = None
    refusal_of: Callable[[str], Reason | None] = lambda _: None

    @property
    def id(self) -> str:
        return self.answers.site.site.id
