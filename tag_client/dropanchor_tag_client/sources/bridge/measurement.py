"""What a format makes of a message, and why it left out something."""

import json
from collections.abc import Iterable, Iterator
from enum import StrEnum
from typing import Any, NamedTuple, Protocol

MAX_PAYLOAD_BYTES = 1_000_000


class Drop(StrEnum):
    """Why a message, or a part of it, was not used."""

    TOO_LONG = "too_long"
    NOT_JSON = "not_json"
    NOT_UNDERSTOOD = "not_understood"
    RETAINED = "retained"
    TAG_INVALID = "tag_invalid"
    OTHER_TAG = "other_tag"
    TOO_MANY_TAGS = "too_many_tags"
    POSITION_ONLY = "position_only"
    DUPLICATE = "duplicate"
    DAMAGED = "damaged"
    SIGN_UNKNOWN = "sign_unknown"
    NO_MOTION = "no_motion"
    UNPAIRED = "unpaired"
    REFUSED = "refused"
    BACKLOG = "backlog"


class Received(NamedTuple):
    """A message and when it arrived, ns UTC. retained: the broker kept it from earlier."""

    topic: str
    payload: bytes
    t_ns: int
    retained: bool = False


class Dropped(NamedTuple):
    """What was left out of a message."""

    reason: Drop
    detail: str


class Measurement(NamedTuple):
    """A sample of a tag. kind: one of `KINDS`, or "health". fields: as in a line of `publish`."""

    tag: str
    kind: str
    fields: dict[str, Any]


Found = Measurement | Dropped


class Format(Protocol):
    """topics: the filters to subscribe to."""

    topics: tuple[str, ...]

    def parse(self, message: Received) -> Iterator[Found]:
        """Yield what a message holds. Never raises, whatever the payload is."""

    def overdue(self, t_ns: int) -> Iterable[Found]:  # noqa: ARG002
        """Return what need not wait any longer for messages that are missing at this time."""
        return ()


def refused_retained(message: Received, way_out: str = "") -> Dropped:
    """Return why a retained message is left out."""
    return Dropped(Drop.RETAINED, f"{message.topic}: the broker kept it, and nobody knows how old it is{way_out}")


def too_long(payload: bytes) -> Dropped:
    return Dropped(Drop.TOO_LONG, f"{len(payload)} bytes")


def json_of(payload: bytes) -> Any:
    """Return the JSON value of a payload, or why there is none."""
    if len(payload) > MAX_PAYLOAD_BYTES:
        return too_long(payload)
    try:
        return json.loads(payload, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        return Dropped(Drop.NOT_JSON, str(error))


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")
