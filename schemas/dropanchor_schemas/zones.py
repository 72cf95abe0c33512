"""Models of zones, and of the rules that make events."""

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import BaseModel, Field, FiniteFloat, model_validator

from dropanchor_schemas.models import Exact
from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import Id, Label, NumberOnly, StrictBool

MAX_POINTS = 200
MAX_COORDINATE_M = 100_000.0
MAX_TAGS = 10_000

Coordinate = Annotated[FiniteFloat, Field(ge=-MAX_COORDINATE_M, le=MAX_COORDINATE_M), NumberOnly]
Ids = Annotated[list[Id], Field(max_length=MAX_TAGS)]


class Polygon(Exact):
    """A polygon in the site frame. Its last point connects to its first."""

    type: Literal["polygon"]
    points: list[Annotated[list[Coordinate], Field(min_length=2, max_length=2)]] = Field(
        min_length=3,
        max_length=MAX_POINTS,
        description="The corners as [x, y], m, in either direction. Edges must not cross, and corners not repeat.",
    )


class Circle(Exact):
    """A circle in the site frame."""

    type: Literal["circle"]
    x: Coordinate = Field(description="Centre, m.")
    y: Coordinate = Field(description="Centre, m.")
    radius_m: Annotated[FiniteFloat, Field(ge=0.1, le=10_000), NumberOnly]


class EventType(StrEnum):
    """What has happened. That of a rule ends with the `type` of the rule."""

    ZONE_ENTER = "dropanchor.zone.enter"
    ZONE_EXIT = "dropanchor.zone.exit"
    ZONE_DWELL = "dropanchor.zone.dwell"
    ZONE_SPEED = "dropanchor.zone.speed"
    TAGS_TOO_CLOSE = "dropanchor.tags.too_close"
    TAG_BATTERY_LOW = "dropanchor.tag.battery_low"
    TAG_LOST = "dropanchor.tag.lost"
    TAG_AMBIGUOUS = "dropanchor.tag.ambiguous"
    EVENT_RETRACTED = "dropanchor.event.retracted"
    ALARM_OVER = "dropanchor.alarm.over"
    ALARM_ACKNOWLEDGED = "dropanchor.alarm.acknowledged"
    DESTINATION_TEST = "dropanchor.destination.test"


class Severity(StrEnum):
    """What a rule makes when it finds something: an event alone, or also an alarm, which lasts until it is over."""

    EVENT = "event"
    WARNING = "warning"
    ALARM = "alarm"


_ALARM = "`warning` and `alarm` also begin an alarm."


class Concerned(Exact):
    """The tags that a zone or a rule concerns. If both lists are empty, it concerns all tags."""

    tags: Ids = Field(default=[], description="Ids of tags.")
    groups: Annotated[list[Annotated[Label, Field(min_length=1)]], Field(max_length=1000)] = Field(
        default=[], description="Groups, as the settings of their tags name them."
    )
    muted_until_ns: Annotated[int, Field(ge=0, lt=2**62)] | None = Field(
        default=None,
        description="UTC, ns: until then its alarms disturb nobody: the page shows them as muted, and no "
        "e-mail tells of its events. null: they do.",
    )

    def is_muted_at(self, t_ns: int) -> bool:
        return self.muted_until_ns is not None and t_ns < self.muted_until_ns


class Zone(Concerned):
    """An area of the site, and the events that tags make there."""

    id: Id = Field(description="Id of the zone, as in its path.")
    name: str = Field(default="", max_length=100, description="Name for people.")
    colour: str = Field(default="#2f6fde", pattern="^#[0-9a-fA-F]{6}$", description="Colour on the map, #rrggbb.")
    shape: Polygon | Circle = Field(discriminator="type")
    enter: StrictBool = Field(default=True, description="Whether entering makes an event.")
    exit: StrictBool = Field(default=True, description="Whether leaving makes an event.")
    dwell_s: Annotated[FiniteFloat, Field(ge=1, le=31_536_000), NumberOnly] | None = Field(
        default=None, description="A tag that stays for so long makes an event, once per stay; null: never."
    )
    speed_mps: Annotated[FiniteFloat, Field(ge=0.1, le=100), NumberOnly] | None = Field(
        default=None, description="A tag inside that moves faster than this makes an event; null: never."
    )
    enter_severity: Severity = Field(default=Severity.EVENT, description=f"What entering makes. {_ALARM}")
    dwell_severity: Severity = Field(default=Severity.EVENT, description=f"What staying too long makes. {_ALARM}")
    speed_severity: Severity = Field(default=Severity.EVENT, description=f"What being too fast makes. {_ALARM}")
    delay_s: Annotated[FiniteFloat, Field(ge=0, le=600), NumberOnly] = Field(
        default=1.0,
        description="How long a tag must be inside or outside, or too fast, before the event.",
    )
    z_min_m: Coordinate | None = Field(default=None, description="Lower end of its heights; null: there is none.")
    z_max_m: Coordinate | None = Field(
        default=None,
        description="Upper end of its heights; null: there is none. A tag of unknown height enters none with an end.",
    )

    @model_validator(mode="after")
    def _top_is_above_bottom(self) -> "Zone":
        if self.z_min_m is not None and self.z_max_m is not None and self.z_max_m <= self.z_min_m:
            raise ValueError(say("zone_heights", "z_max_m must be above z_min_m"))
        return self


class ZoneList(BaseModel):
    """The zones of the site."""

    zones: list[Zone]


class TagInZone(BaseModel):
    """A tag in a zone, and since when."""

    tag: Id
    since_ns: int = Field(description="When it entered, UTC in ns.")


class ZoneOccupancy(BaseModel):
    """How many tags are in a zone, and which if that was asked for."""

    zone: Id
    tags: int = Field(ge=1, description="Tags that have entered and not left, with the certainty of an event.")
    inside: list[TagInZone] | None = Field(
        default=None, description="The tags, those first that have been there longest; with `names=true` only."
    )


class ZoneOccupancyList(BaseModel):
    """The zones that are not empty."""

    zones: list[ZoneOccupancy]


class _Rule(Concerned):
    id: Id = Field(description="Id of the rule, as in its path.")
    name: str = Field(default="", max_length=100, description="Name for people.")
    severity: Severity = Field(default=Severity.EVENT, description=f"What it makes. {_ALARM}")


class TooCloseRule(_Rule):
    """Two of the tags are closer than `distance_m`. One event per approach, about the tag whose id comes first.

    Heights count where both are known, and tags that are surely on two floors of the plans are not close.
    """

    type: Literal["too_close"]
    distance_m: Annotated[FiniteFloat, Field(ge=0.1, le=1000, examples=[3.0]), NumberOnly]
    delay_s: Annotated[FiniteFloat, Field(ge=0, le=600), NumberOnly] = Field(
        default=1.0, description="How long they must be so close."
    )


class BatteryLowRule(_Rule):
    """The charge that a tag reports is below `fraction`. The rule is ready again 0.05 above it."""

    type: Literal["battery_low"]
    fraction: Annotated[FiniteFloat, Field(ge=0.01, le=0.9), NumberOnly] = 0.2


class LostRule(_Rule):
    """A tag has been `lost` for `after_s`."""

    type: Literal["lost"]
    after_s: Annotated[FiniteFloat, Field(ge=0, le=86_400), NumberOnly] = 60.0


class AmbiguousRule(_Rule):
    """A tag has been `ambiguous` for `after_s`."""

    type: Literal["ambiguous"]
    after_s: Annotated[FiniteFloat, Field(ge=0, le=86_400), NumberOnly] = 120.0


TagRule = BatteryLowRule | LostRule | AmbiguousRule
EventRule = Annotated[TooCloseRule | TagRule, Field(discriminator="type")]


class EventRuleList(BaseModel):
    """The rules that need no zone."""

    rules: list[EventRule]
