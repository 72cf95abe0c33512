"""The settings of events and their delivery."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, IPvAnyNetwork, model_validator

from dropanchor_schemas.destinations import Address
from dropanchor_schemas.models import Exact
from dropanchor_service.settings.lists import as_list


class EventSettings(Exact):
    """How events are found, and which are kept. Zones and rules are set over REST."""

    period_ms: Annotated[float, Field(ge=50, le=10_000)] = Field(
        default=200.0, description="Period in which new poses are compared with the zones and rules."
    )
    keep_days: Annotated[float, Field(gt=0, le=36_500)] = Field(default=30.0, description="Delete older events.")
    max_mib: Annotated[float, Field(ge=1)] = Field(
        default=1024.0, description="Size of the stored events; the oldest make room."
    )


class DeliverySettings(Exact):
    """How events are delivered to destinations. The destinations are set over REST."""

    allow_networks: Annotated[tuple[IPvAnyNetwork, ...], BeforeValidator(as_list)] = Field(
        default=(),
        description='Networks of receivers inside, such as "10.1.0.0/16". Other addresses must be public, so that '
        "nobody can reach internal machines through a webhook, or by what a name stands for. A mail server or broker "
        "whose address itself is in the settings, or `localhost`, needs none.",
    )
    authorities: Path | None = Field(
        default=None,
        description="PEM file with authorities that are trusted beside the public ones, for https://, e-mail and MQTT.",
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
    page: Annotated[str, Field(pattern=r"^https?://[^\s#]+$")] | None = Field(
        default=None, description="URL of the page as people reach it, for the links in e-mails."
    )


class _ServerSettings(Exact):
    server: str | None = Field(default=None, description="Name or address; not set: there is none.")
    port: Annotated[int, Field(ge=1, le=65_535)] | None = Field(default=None, description="Not set: the usual port.")
    user: str | None = Field(default=None, description="Name to log in with; not set: no login.")
    password_file: Path | None = Field(default=None, description="File with the password, without anything else.")

    @property
    def is_encrypted(self) -> bool:
        """Whether the connection uses TLS."""
        raise NotImplementedError

    @model_validator(mode="after")
    def _password_stays_secret(self) -> "_ServerSettings":
        if (self.user is None) != (self.password_file is None):
            raise ValueError("`user` and `password_file` belong together: set both or none")
        if self.user is not None and not self.is_encrypted:
            raise ValueError("without TLS the password could be read on the way: set `tls`, or no `user`")
        return self


class EmailSettings(_ServerSettings):
    """The mail server (SMTP) that events leave through."""

    tls: Literal["starttls", "tls", "none"] = Field(
        default="starttls", description="`starttls` (port 587), `tls` from the first byte (465), or `none` (25)."
    )
    sender: Address = Field(default="dropanchor@localhost", description="The address that mails come from.")

    @property
    def is_encrypted(self) -> bool:
        return self.tls != "none"


class MqttSettings(_ServerSettings):
    """The MQTT broker that events and poses are published to. It needs the extra `mqtt`."""

    tls: bool = Field(default=True, description="Connect with TLS (port 8883), or without it (1883).")
    version: Literal["5", "3.1.1"] = Field(
        default="5", description="Of MQTT. A broker cannot say in `3.1.1` that it refuses a message."
    )

    @property
    def is_encrypted(self) -> bool:
        return self.tls
