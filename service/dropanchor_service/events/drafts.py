"""What becomes an event, and what has to be remembered with it."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from dropanchor_schemas.events import RetractionReason
from dropanchor_schemas.zones import EventType


class StateKey(NamedTuple):
    """Whose state it is. source: `zone` or `rule`. other: the second tag of a pair, else empty."""

    source: str
    item: str
    tag: str
    other: str = ""


class AlarmBegan(NamedTuple):
    """An alarm lasts as long as a state has a flag."""

    key: StateKey
    flag: int


@dataclass(frozen=True)
class Draft:
    """An event before it is stored. data: of `EventData`, without what is null.

    alarm: that it begins. is_muted: whether it disturbs nobody.
    """

    type: EventType
    tag: str
    data: Mapping[str, Any]
    alarm: AlarmBegan | None = None
    is_muted: bool = False

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


class StateValue(NamedTuple):
    flags: int
    since_ns: int


class Stay(NamedTuple):
    """A tag was in a zone, with the certainty of an event."""

    tag: str
    zone: str
    entered_ns: int
    left_ns: int


class StartBegan(NamedTuple):
    """The first thing that came of a start: events of its tag from here on hang on it.

    place, before: as in StartNews. since_ns: no stay that hangs on it began earlier. inside: the zones in which the tag
    was when the start was told.
    """

    tag: str
    place: str
    before: str
    since_ns: int
    inside: Mapping[str, StateValue]

    def made(self, stay: Stay) -> bool:
        """Return whether a stay hangs on this start: it began or ended after it."""
        was_inside = self.inside.get(stay.zone)
        reopened = was_inside is not None and was_inside.since_ns == stay.entered_ns
        return stay.tag == self.tag and (reopened or stay.entered_ns >= self.since_ns)


class StartClosed(NamedTuple):
    """Nothing hangs on the start of the tag from here on. retracts: why its events are not true; None: they are."""

    tag: str
    t_ns: int
    retracts: RetractionReason | None = None


class AlarmsOver(NamedTuple):
    """A state has lost these flags, and the alarms that hung on them are over."""

    key: StateKey
    flags: int
    t_ns: int
    is_muted: bool


Happening = Draft | StartBegan | StartClosed | AlarmsOver

States = dict[StateKey, StateValue | None]
"""New states by key; None: the state ends."""


def rounded(value: Any, decimals: int = 4) -> float | None:
    """Return the number for JSON, None when it is not finite."""
    return round(float(value), decimals) if math.isfinite(value) else None
