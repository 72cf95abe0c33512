"""What a format makes of a message, and why it left out something."""

import json
from collections.abc import Iterator
from enum import StrEnum
from typing import Any, NamedTuple, Protocol

MAX_PAYLOAD_BYTES = 1_000_000


class Drop(StrEnum):
    """Why a message, or a part of it, was not used."""

    TOO_LONG = "too_long"
    NOT_JSON = "not_json"
    NOT_UNDERSTOOD = "not_understood"
    TAG_INVALID = "tag_invalid"
    TOO_MANY_TAGS = "too_many_tags"
    POSITION_ONLY = "position_only"
    DUPLICATE = "duplicate"
    UNPAIRED = "unpaired"
    BACKLOG = "backlog"


class Dropped(NamedTuple):
    """What was left out of a message."""

    reason: Drop
    detail: str


class Measurement(NamedTuple):
    """A sample of a tag. kind: "range", "imu", "heading", "bearing" or "health". fields: as in a line of `publish`."""

    tag: str
    kind: str
    fields: dict[str, Any]


class Format(Protocol):
    """topics: the filters to subscribe to."""

    topics: tuple[str, ...]

    def parse(self, topic: str, payload: bytes, t_ns: int) -> Iterator[Measurement | Dropped]:
        """Yield what a message holds. t_ns: when it arrived. Never raises, whatever the payload is."""


def json_of(payload: bytes) -> Any:
    """Return the JSON value of a payload, or why there is none."""
    if len(payload) > MAX_PAYLOAD_BYTES:
        return Dropped(Drop.TOO_LONG, f"{len(payload)} bytes")
    try:
        return json.loads(payload, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        return Dropped(Drop.NOT_JSON, str(error))


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")
