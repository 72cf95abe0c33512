"""The messages of the WebSocket: what clients send, and the errors that they get."""

from enum import IntEnum
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from dropanchor_schemas.models import Exact


class Code(IntEnum):
    """The error codes of the standard."""

    UNKNOWN_EVENT = 10000
    UNKNOWN_TOPIC = 10001
    SUBSCRIPTION_FAILED = 10002
    UNSUBSCRIBE_FAILED = 10003
    NOT_AUTHORIZED = 10004
    INVALID_DATA = 10005
    NOT_AUTHENTICATED = 10006
    INVALID_LICENCE = 10007


class FeedError(Exception):
    """A message of a client cannot be served. The description says what to do."""

    def __init__(self, code: Code, description: str) -> None:
        super().__init__(description)
        self.code = code
        self.description = description

    def message(self) -> dict[str, Any]:
        return {"event": "error", "code": int(self.code), "description": self.description}


class Request(BaseModel):
    """What a client sends."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    event: str
    topic: str | None = None
    subscription_id: int | None = None
    params: dict[str, Any] | None = None


def request_of(text: str) -> Request:
    """Return a client's message. Raises FeedError."""
    try:
        return Request.model_validate_json(text)
    except ValidationError as error:
        found = error.errors()[0]
        place = ".".join(str(part) for part in found["loc"]) or "message"
        raise FeedError(
            Code.INVALID_DATA, f"The message is not an object with `event`: {place}: {found['msg']}."
        ) from None


class Params(Exact):
    """The parameters of a subscription. Each condition may be one value or a list of values."""

    token: str | None = None
    crs: Literal["local", "EPSG:4326"] | None = None
    zone_id: str | None = None
    provider_id: str | list[str] | None = None
    provider_type: str | list[str] | None = None
    source: str | list[str] | None = None
    accuracy: float | None = Field(default=None, description="Only positions at least as accurate, m.")
    floor: float | None = None
    id: str | list[str] | None = None
    trackable_id: str | list[str] | None = None
    fence_id: str | list[str] | None = None
    foreign_id: str | list[str] | None = None
    event_type: str | list[str] | None = None
    object_type: str | list[str] | None = None
    object_id_1: str | None = None
    object_id_2: str | None = None
    collision_type: str | list[str] | None = None


def params_of(values: dict[str, Any] | None) -> Params:
    """Return the parameters of a subscription. Raises FeedError."""
    try:
        return Params.model_validate(values or {})
    except ValidationError as error:
        found = error.errors()[0]
        known = ", ".join(Params.model_fields)
        raise FeedError(
            Code.SUBSCRIPTION_FAILED, f"params.{found['loc'][0]}: {found['msg']}. The parameters are: {known}."
        ) from None


def allows(wanted: str | list[str] | None, *values: str | None) -> bool:
    """Return whether a condition allows an object with these values. Ids count in upper and lower case alike."""
    if wanted is None:
        return True
    names = {name.lower() for name in ([wanted] if isinstance(wanted, str) else wanted)}
    return any(value is not None and value.lower() in names for value in values)
