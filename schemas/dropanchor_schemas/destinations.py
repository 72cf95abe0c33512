"""Models of destinations: who gets which events, how, and what became of them."""

import re
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, Field, FiniteFloat

from dropanchor_schemas.events import Event
from dropanchor_schemas.models import Exact, Frozen
from dropanchor_schemas.pose import Phrase
from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import Id, NumberOnly, StrictBool
from dropanchor_schemas.zones import EventType

SECRET_PREFIX = "whsec_"
ADDRESS = r"^[A-Za-z0-9.!#$%&'*+/=?^_`{|}~-]+@[A-Za-z0-9.-]+$"
TOPIC = r"^([A-Za-z0-9._ /:-]|\{site\}|\{tag\}|\{type\})+$"
LEVELS = r"^[A-Za-z0-9._ :-]+(/[A-Za-z0-9._ :-]+)*$"


def _require_address(text: str) -> str:
    if not re.fullmatch(ADDRESS, text):
        raise ValueError(say("no_address", "{text} is no address such as shift@example.com", text=repr(text)))
    return text


def _require_topic(text: str) -> str:
    if not re.fullmatch(TOPIC, text):
        raise ValueError(
            say(
                "no_topic",
                "{text} is no topic such as yard/{tag}/event; {site}, {tag} and {type} are replaced",
                text=repr(text),
                tag="{tag}",
                site="{site}",
                type="{type}",
            )
        )
    return text


Address = Annotated[
    str, Field(max_length=254, json_schema_extra={"pattern": ADDRESS}), AfterValidator(_require_address)
]
Topic = Annotated[str, Field(max_length=512, json_schema_extra={"pattern": TOPIC}), AfterValidator(_require_topic)]


class Language(StrEnum):
    """The language of mails."""

    ENGLISH = "en"
    GERMAN = "de"


class _Destination(Exact):
    id: Id = Field(description="Id of the destination, as in its path.")
    enabled: StrictBool = Field(default=True, description="Whether new events are queued for it.")


class _EventDestination(_Destination):
    types: list[EventType] = Field(default=[], max_length=50, description="Only events of these types; empty: all.")
    zones: Annotated[list[Id], Field(max_length=1000)] = Field(
        default=[], description="Only events of these zones; empty: all."
    )
    tags: Annotated[list[Id], Field(max_length=10_000)] = Field(
        default=[], description="Only events of these tags; empty: all."
    )


class WebhookDestination(_EventDestination):
    """A receiver of events over HTTP: one signed POST for each event."""

    type: Literal["webhook"]
    url: str = Field(
        max_length=2000,
        description="Where events are posted: https:// or http://. What stands after the host is never returned: "
        "answers have `…` in its place, and a URL that is sent back so keeps the present one.",
    )
    secret: str | None = Field(
        default=None,
        max_length=200,
        description="Key of the signature: `whsec_` and the Base64 of 24 to 64 random bytes. It is never returned. "
        "null keeps the present one.",
    )


class EmailDestination(_EventDestination):
    """People who get events by e-mail. The mail server is in the settings."""

    type: Literal["email"]
    to: list[Address] = Field(min_length=1, max_length=50, description="Addresses of the recipients.")
    digest_s: Annotated[FiniteFloat, Field(ge=0, le=600), NumberOnly] = Field(
        default=60.0, description="Least time between two mails. A mail has all events that happened meanwhile."
    )
    language: Language = Field(default=Language.ENGLISH, description="The language of the mails: `en` or `de`.")


class MqttDestination(_EventDestination):
    """A topic of the MQTT broker in the settings: one message (QoS 1) for each event."""

    type: Literal["mqtt"]
    topic: Topic = Field(
        default="dropanchor/{site}/{tag}/event",
        description="The topic. `{site}`, `{tag}` and `{type}` stand for those of the event.",
    )


class MqttPosesDestination(_Destination):
    """Poses of tags and the tags in each zone, as retained messages of the MQTT broker in the settings.

    They are states and no events: only the newest of each waits for a broker that is away, and none becomes a dead
    letter.
    """

    type: Literal["mqtt_poses"]
    enabled: StrictBool = Field(default=True, description="Whether they are published.")
    zones: Annotated[list[Id], Field(max_length=1000)] = Field(default=[], description="Only these zones; empty: all.")
    tags: Annotated[list[Id], Field(max_length=10_000)] = Field(default=[], description="Only these tags; empty: all.")
    prefix: str = Field(
        default="dropanchor",
        pattern=LEVELS,
        max_length=200,
        description="What topics begin with: `<prefix>/<site>/tag/<tag>`, `…/zone/<zone>` and `…/status`.",
    )
    discovery: str = Field(
        default="homeassistant",
        pattern=f"^$|{LEVELS}",
        max_length=200,
        description="What the topics begin with by which Home Assistant finds tags and zones; empty: it does not.",
    )
    interval_s: Annotated[FiniteFloat, Field(ge=0.2, le=3600), NumberOnly] = Field(
        default=1.0,
        description="Least time between two poses of a tag. A change of its state or zones is sent at once.",
    )
    deadband_m: Annotated[FiniteFloat, Field(ge=0, le=1000), NumberOnly] = Field(
        default=0.1,
        description="A pose is sent when a coordinate or `sigma_pos_m` differs so much from the last one, and once a "
        "minute.",
    )


EventDestination = WebhookDestination | EmailDestination | MqttDestination
Destination = Annotated[
    WebhookDestination | EmailDestination | MqttDestination | MqttPosesDestination, Field(discriminator="type")
]


class DestinationState(Frozen):
    """A destination and its queue."""

    destination: Destination = Field(description="As it was put, but without its secret and the path of its URL.")
    has_secret: bool = Field(description="Whether the service knows the secret of a webhook.")
    pending: int = Field(description="Events that wait for delivery.")
    oldest_ns: int | None = Field(description="UTC, ns: when the oldest of them happened; null: none waits.")
    dead: int = Field(description="Dead letters: events whose delivery was given up.")
    problem: str | None = Field(description="What went wrong at the last attempt; null: nothing.")


class DestinationList(BaseModel):
    """The destinations of the site."""

    destinations: list[DestinationState]
    unavailable: dict[str, str] = Field(
        description="Types of destinations that cannot be made before the settings have what they need, each with what."
    )
    unavailable_phrases: dict[str, Phrase | None] = Field(
        default={}, description="Each entry of `unavailable` by its code; null for one without."
    )


class ReceiverNetwork(Frozen):
    """A network inside whose machines may receive events."""

    network: str = Field(description="The network, such as `192.168.1.0/24`.")
    in_settings: bool = Field(description="Whether the settings allow it, so that it cannot be removed here.")


class ReceiverNetworkList(BaseModel):
    """The networks inside whose machines may receive events."""

    networks: list[ReceiverNetwork]


class DestinationTest(Frozen):
    """What became of a test event."""

    delivered: bool
    detail: str = Field(description="What the receiver answered, or why there is no answer.")


class DeadLetter(Frozen):
    """An event that was not delivered, and why."""

    event: Event
    reason: str


class DeadLetterList(BaseModel):
    """The oldest dead letters of a destination, at most 1000."""

    dead_letters: list[DeadLetter]


class Retried(Frozen):
    """How many dead letters went back to the queue."""

    retried: int
