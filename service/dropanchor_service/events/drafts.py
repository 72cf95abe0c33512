"""What becomes an event, and what has to be remembered with it."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from dropanchor_schemas.events import EventType


@dataclass(frozen=True)
class Draft:
    """An event before it is stored. data: of `EventData`, without what is null."""

    type: EventType
    tag: str
    data: Mapping[str, Any]

    @property
    def t_ns(self) -> int:
        return int(self.data["t_ns"])

    @property
    def zone(self) -> str | None:
        return self.data.get("zone")


def destination_test(destination: str) -> Draft:
    """Return an event that only shows that a destination works."""
    now_ns = time.time_ns()
    return Draft(EventType.DESTINATION_TEST, destination, {"t_ns": now_ns, "since_ns": now_ns, "name": destination})


class StateKey(NamedTuple):
    """Whose state it is. source: `zone` or `rule`. other: the second tag of a pair, else empty."""

    source: str
    item: str
    tag: str
    other: str = ""


class StateValue(NamedTuple):
    flags: int
    since_ns: int


class Stay(NamedTuple):
    """A tag was in a zone, with the certainty of an event."""

    tag: str
    zone: str
    entered_ns: int
    left_ns: int


States = dict[StateKey, StateValue | None]
"""New states by key; None: the state ends."""


def rounded(value: Any, decimals: int = 4) -> float | None:
    """Return the number for JSON, None when it is not finite."""
    return round(float(value), decimals) if math.isfinite(value) else None
