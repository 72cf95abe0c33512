"""The settings of events and webhooks."""

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, IPvAnyNetwork


def _as_list(value: object) -> object:
    """Split text at commas, so that an environment variable can hold several networks."""
    return [part.strip() for part in value.split(",") if part.strip()] if isinstance(value, str) else value


class EventSettings(BaseModel):
    """How events are found, and which are kept. Zones and rules are set over REST."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    period_ms: Annotated[float, Field(ge=50, le=10_000)] = Field(
        default=200.0, description="Period in which new poses are compared with the zones and rules."
    )
    keep_days: Annotated[float, Field(gt=0, le=36_500)] = Field(default=30.0, description="Delete older events.")
    most_mib: Annotated[float, Field(ge=1)] = Field(
        default=1024.0, description="Size of the stored events; the oldest make room."
    )


class WebhookSettings(BaseModel):
    """How events are delivered to webhooks. The webhooks are set over REST."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    allow_networks: Annotated[tuple[IPvAnyNetwork, ...], BeforeValidator(_as_list)] = Field(
        default=(),
        description='Networks of receivers inside, such as "10.1.0.0/16". Other addresses must be public, so that '
        "nobody can reach internal machines through a webhook.",
    )
    authorities: Path | None = Field(
        default=None, description="PEM file with authorities that are trusted beside the public ones, for https://."
    )
    timeout_s: Annotated[float, Field(ge=0.1, le=120)] = Field(
        default=10.0, description="Time that a receiver has to answer."
    )
    retry_s: Annotated[float, Field(ge=0.1, le=3600)] = Field(
        default=60.0, description="Longest time between two attempts; the time doubles until then."
    )
    give_up_hours: Annotated[float, Field(gt=0, le=8760)] = Field(
        default=24.0, description="Age at which an event that cannot be delivered becomes a dead letter."
    )
