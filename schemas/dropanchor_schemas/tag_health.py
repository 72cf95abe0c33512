"""The JSON payload of a tag's health, and the models of what the service answers about it."""

from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from dropanchor_schemas.health import LIMITS, MAX_FIRMWARE_LENGTH, MAX_HEALTH_BYTES, is_absurd
from dropanchor_schemas.models import Frozen
from dropanchor_schemas.pose import Phrase
from dropanchor_schemas.samples import rejection_of, unknown_version
from dropanchor_schemas.site import RemoteSettings
from dropanchor_schemas.wire import ENCODING_JSON, Reason, Rejection


def _number(name: str, meaning: str) -> Any:
    low, high = LIMITS[name]
    return Field(default=None, description=f"{meaning} The service drops a value outside {low:g} to {high:g}.")


class _Values(BaseModel):
    """What a tag can say about itself. Every value is optional."""

    battery_fraction: float | None = _number("battery_fraction", "Charge of the battery; 1: full.")
    battery_v: float | None = _number("battery_v", "Voltage of the battery, V.")
    temperature_c: float | None = _number("temperature_c", "Temperature of the tag, °C.")
    firmware: Annotated[str, Field(min_length=1, max_length=MAX_FIRMWARE_LENGTH)] | None = Field(
        default=None, description="Version of the tag's firmware or program, as its maker writes it."
    )
    rssi_dbm: float | None = _number("rssi_dbm", "Strength of the signal of the tag's network link, dBm.")
    spool_bytes: int | None = _number("spool_bytes", "Size of the messages that wait on the tag's disk, bytes.")
    spool_oldest_s: float | None = _number("spool_oldest_s", "Age of the oldest of them, s.")
    lost_messages: int | None = _number("lost_messages", "Messages that the tag had to delete since its start.")


class TagHealthMessage(_Values):
    """The health of one tag. It replaces the values that it contains; the others stay as they were."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        json_schema_extra={
            "examples": [
                {"battery_fraction": 0.83},
                {
                    "version": 1,
                    "battery_fraction": 0.83,
                    "battery_v": 3.92,
                    "temperature_c": 24.5,
                    "firmware": "1.4.2",
                    "rssi_dbm": -61.0,
                    "spool_bytes": 0,
                    "spool_oldest_s": 0.0,
                    "lost_messages": 0,
                },
            ]
        },
    )

    version: int = Field(default=1, ge=1, le=1, description="Version of this schema; decoders reject others.")
    settings: RemoteSettings | None = Field(
        default=None, description="What the tag's program applies of the settings that the service has for it."
    )


class TagHealth(_Values):
    """The last known value of everything that the tag has reported since the service started."""

    model_config = ConfigDict(frozen=True)

    age_s: float = Field(description="Time since the tag's last report.")


CareReason = Literal[
    "sensor_fault", "battery_low", "firmware_differs", "spool_growing", "clock_offset", "clock_wrong", "no_contact"
]


class Care(Frozen):
    """One thing that a person should do for a tag."""

    reason: CareReason
    hint: str
    hint_phrase: Phrase | None = Field(default=None, description="The hint by its code; null without one.")
    setting: dict[str, str | bool] | None = Field(
        default=None, description="Setting of the tag that mends it, for a person to accept; null: none does."
    )


class HealthReport(NamedTuple):
    """Decoded health. values: by name, without those that are absurd. absurd: the names of these."""

    values: dict[str, Any]
    absurd: tuple[str, ...]


def decode_health(payload: bytes, encoding: str) -> HealthReport | Rejection:
    """Decode the health of a tag. A value that is out of limits is left out; a malformed message is rejected."""
    if encoding != ENCODING_JSON:
        return Rejection(Reason.ENCODING_UNKNOWN, f"health is {ENCODING_JSON}")
    if len(payload) == 0:
        return Rejection(Reason.PAYLOAD_EMPTY, "the payload is empty")
    if len(payload) > MAX_HEALTH_BYTES:
        return Rejection(Reason.PAYLOAD_TOO_LARGE, f"{len(payload)} bytes, at most {MAX_HEALTH_BYTES}")
    try:
        message = TagHealthMessage.model_validate_json(payload)
    except ValidationError as error:
        return unknown_version(payload) or rejection_of(error)
    given = message.model_dump(exclude={"version"}, exclude_none=True)
    if not given:
        return Rejection(Reason.NO_HEALTH, "the message holds no values")
    absurd = tuple(name for name, value in given.items() if is_absurd(name, value))
    return HealthReport({name: value for name, value in given.items() if name not in absurd}, absurd)
