"""Models of webhooks: who gets which events over HTTP, and what became of them."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from dropanchor_schemas.events import Event, EventType
from dropanchor_schemas.site import Id, StrictBool

SECRET_PREFIX = "whsec_"


class Webhook(BaseModel):
    """A receiver of events."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: Id = Field(description="Id of the webhook, as in its path.")
    url: str = Field(max_length=2000, description="Where events are posted: https:// or http://.")
    secret: str | None = Field(
        default=None,
        max_length=200,
        description="Key of the signature: `whsec_` and the Base64 of 24 to 64 random bytes. It is never returned. "
        "null keeps the present one.",
    )
    enabled: StrictBool = Field(default=True, description="Whether new events are queued for it.")
    types: list[EventType] = Field(default=[], max_length=50, description="Only events of these types; empty: all.")
    zones: Annotated[list[Id], Field(max_length=1000)] = Field(
        default=[], description="Only events of these zones; empty: all."
    )
    tags: Annotated[list[Id], Field(max_length=10_000)] = Field(
        default=[], description="Only events of these tags; empty: all."
    )


class WebhookStatus(BaseModel):
    """A webhook without its secret, and the state of its queue."""

    model_config = ConfigDict(frozen=True)

    id: str
    url: str
    has_secret: bool
    enabled: bool
    types: list[EventType]
    zones: list[str]
    tags: list[str]
    pending: int = Field(description="Events that wait for delivery.")
    dead: int = Field(description="Dead letters: events whose delivery was given up.")
    problem: str | None = Field(description="Why the last attempt failed; null if it did not.")


class WebhookList(BaseModel):
    """The webhooks of the site."""

    webhooks: list[WebhookStatus]


class WebhookTest(BaseModel):
    """What the receiver made of a test event."""

    model_config = ConfigDict(frozen=True)

    delivered: bool
    detail: str = Field(description="What the receiver answered, or why there is no answer.")


class DeadLetter(BaseModel):
    """An event that was not delivered, and why."""

    model_config = ConfigDict(frozen=True)

    event: Event
    reason: str


class DeadLetterList(BaseModel):
    """The oldest dead letters of a webhook, at most 1000."""

    dead_letters: list[DeadLetter]


class Retried(BaseModel):
    """How many dead letters went back to the queue."""

    model_config = ConfigDict(frozen=True)

    retried: int
