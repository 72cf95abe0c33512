"""Models of events: CloudEvents 1.0 in JSON."""

from enum import StrEnum
from typing import Literal

from pydantic import Field

from dropanchor_schemas.models import Frozen
from dropanchor_schemas.zones import EventType, Severity


class RetractionReason(StrEnum):
    """Why an event is retracted: what was said about the start of the tag was wrong."""

    START_DENIED = "start_denied"  # the ranges contradict it
    START_TAKEN_BACK = "start_taken_back"  # an operator took it back


class EventData(Frozen):
    """What is known about the event. Fields that do not belong to its type are null."""

    t_ns: int = Field(description="UTC, ns: when the event was certain. `time` of the envelope is the same.")
    since_ns: int = Field(description="UTC, ns: since when its condition has held.")
    zone: str | None = Field(default=None, description="Id of the zone.")
    rule: str | None = Field(default=None, description="Id of the rule, of events without a zone.")
    name: str = Field(default="", description="Name of the zone or rule.")
    x: float | None = Field(default=None, description="Position of the tag in the site frame, m.")
    y: float | None = None
    probability: float | None = Field(
        default=None, description="Probability that the tag is inside (exit: outside), or that the tags are too close."
    )
    other_tag: str | None = Field(default=None, description="The other of two tags that are too close.")
    distance_m: float | None = Field(default=None, description="Distance of their estimated positions.")
    speed_mps: float | None = None
    battery_fraction: float | None = None
    retracts: str | None = Field(
        default=None,
        description="`id` of an earlier event that is not true: treat it as if it had not happened. It was made from "
        "where a person said that the tag is. `zone`, `rule`, `name` and `other_tag` are those of that event, and "
        "`since_ns` is its `t_ns`.",
    )
    retracted_type: EventType | None = Field(default=None, description="`type` of the event that is retracted.")
    reason: RetractionReason | None = Field(
        default=None,
        description="Why it is retracted: `start_denied`: the ranges contradict the start of the tag; "
        "`start_taken_back`: an operator took it back.",
    )
    severity: Severity | None = Field(
        default=None, description="Of the alarm that this event begins, ends or acknowledges; null: it concerns none."
    )
    alarm: str | None = Field(
        default=None,
        description="`id` of the event that began the alarm which is over or acknowledged. `zone`, `rule`, `name` and "
        "`other_tag` are those of that event, and so is `since_ns`.",
    )
    alarm_type: EventType | None = Field(default=None, description="`type` of that event.")
    acknowledged_by: str | None = Field(default=None, description="Who acknowledged it; empty: somebody without a key.")
    note: str | None = Field(default=None, description="What was noted then.")


class Event(Frozen):
    """An event in the JSON format of CloudEvents 1.0. `id` stays the same however often the event is delivered."""

    specversion: Literal["1.0"] = "1.0"
    id: str = Field(description="Unique. A receiver that has seen it drops the event.")
    source: str = Field(description="`urn:dropanchor:site:` and the id of the site.")
    type: EventType
    subject: str = Field(description="Id of the tag; of a test, the id of the destination.")
    time: str = Field(description="RFC 3339, UTC.")
    sequence: str = Field(description="Position in the order of all events of the service: 20 digits, which sort.")
    datacontenttype: Literal["application/json"] = "application/json"
    data: EventData


class EventList(Frozen):
    """One page of stored events, oldest first."""

    events: list[Event]
    next: str | None = Field(description="`after` of the next page; null when there are no more events now.")
