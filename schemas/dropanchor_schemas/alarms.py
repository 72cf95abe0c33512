"""Models of alarms: what a rule began, until it is over, and who has acknowledged it."""

from pydantic import BaseModel, Field

from dropanchor_schemas.audit import Author
from dropanchor_schemas.events import Event
from dropanchor_schemas.models import Exact, Frozen
from dropanchor_schemas.zones import Severity


class AcknowledgementNote(Exact):
    """What to note when an alarm is acknowledged."""

    note: str = Field(default="", max_length=500, description="For those who look at it later.")


class Acknowledgement(Frozen):
    """Somebody has seen an alarm."""

    by: Author
    t_ns: int = Field(description="UTC, ns.")
    note: str


class Alarm(Frozen):
    """Something that a rule with the severity `warning` or `alarm` found."""

    id: str = Field(description="`id` of the event that began it.")
    severity: Severity
    began_ns: int = Field(description="UTC, ns: since when its condition has held.")
    over_ns: int | None = Field(description="UTC, ns: when it was over; null: it is not.")
    acknowledged: Acknowledgement | None = Field(description="null: nobody has acknowledged it.")
    muted_until_ns: int | None = Field(description="Until when its zone or rule is muted; null: it never was.")
    event: Event = Field(description="What began it: whose alarm it is, where, and of which zone or rule.")


class AlarmList(BaseModel):
    """Alarms, the newest first."""

    alarms: list[Alarm]
    next: str | None = Field(description="`before` of the next page; null: there is none.")
