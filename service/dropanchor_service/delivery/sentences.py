"""Events as sentences for people."""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from urllib.parse import urlencode

from dropanchor_schemas.events import Event, EventData, EventType
from dropanchor_service.events.store import rfc3339

SOURCE_PREFIX = "urn:dropanchor:site:"
NameOf = Callable[[str], str]
"""Returns how people call a tag."""

_AROUND_NS = 300_000_000_000  # of the past that a link shows, before and after the event

_SENTENCES: Mapping[EventType, Callable[[str, str, EventData], str]] = {
    EventType.ZONE_ENTER: lambda tag, place, _: f"{tag} entered {place}",
    EventType.ZONE_EXIT: lambda tag, place, _: f"{tag} left {place}",
    EventType.ZONE_DWELL: lambda tag, place, data: f"{tag} has been in {place} for {_lasted(data)}",
    EventType.ZONE_SPEED: lambda tag, place, data: f"{tag} is too fast in {place}: {_number(data.speed_mps)} m/s",
    EventType.TAGS_TOO_CLOSE: lambda tag, _, data: (
        f"{tag} and {data.other_tag} are too close: {_number(data.distance_m)} m"
    ),
    EventType.TAG_BATTERY_LOW: lambda tag, _, data: f"The battery of {tag} is low: {_percent(data.battery_fraction)}",
    EventType.TAG_LOST: lambda tag, _, data: f"{tag} has been lost for {_lasted(data)}",
    EventType.TAG_AMBIGUOUS: lambda tag, _, data: f"{tag} has been ambiguous for {_lasted(data)}",
    EventType.DESTINATION_TEST: lambda tag, _place, _data: f"This is a test of the destination {tag}",
}
_KINDS: Mapping[EventType, str] = {
    EventType.ZONE_ENTER: "entered",
    EventType.ZONE_EXIT: "left",
    EventType.ZONE_DWELL: "too long in",
    EventType.ZONE_SPEED: "too fast in",
    EventType.TAGS_TOO_CLOSE: "too close:",
    EventType.TAG_BATTERY_LOW: "battery low:",
    EventType.TAG_LOST: "lost:",
    EventType.TAG_AMBIGUOUS: "ambiguous:",
    EventType.DESTINATION_TEST: "test of",
}


def sentence(event: Event, name_of: NameOf) -> str:
    """Return what happened in one line, such as `Cart 3 (cart-3) entered Loading dock`."""
    data = event.data
    if data.other_tag is not None:
        data = data.model_copy(update={"other_tag": name_of(data.other_tag)})
    return " ".join(_SENTENCES[event.type](name_of(event.subject), _place(data), data).split())


def kind(event: Event) -> str:
    """Return what events of several tags have in common, such as `entered Loading dock`."""
    return " ".join(f"{_KINDS[event.type]} {_place(event.data)}".split())


def place_and_time(event: Event) -> str:
    """Return where, how surely and when it happened, such as `at x 3.2 m, y 1.7 m; …`."""
    data = event.data
    where = [] if data.x is None else [f"x {_number(data.x)} m, y {_number(data.y)} m"]
    sure = [] if data.probability is None else [f"probability {int(data.probability * 100) / 100:.2f}"]
    when = datetime.fromtimestamp(data.t_ns / 1e9, UTC).astimezone()
    return "; ".join([f"{when:%Y-%m-%d %H:%M:%S %Z}", *where, *sure])


def site_of(event: Event) -> str:
    """Return the id of the site of an event."""
    return event.source.removeprefix(SOURCE_PREFIX)


def link(page: str, event: Event) -> str:
    """Return the URL at which the page shows the tag at the moment of the event."""
    t_ns = event.data.t_ns
    moments = {"from": t_ns - _AROUND_NS, "to": t_ns + _AROUND_NS, "at": t_ns}
    values = {name: rfc3339(moment) for name, moment in moments.items()} | {"tag": event.subject}
    return f"{page}#{urlencode(values, safe=':')}"


def _place(data: EventData) -> str:
    return data.name or data.zone or data.rule or ""


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:.1f}"


def _percent(value: float | None) -> str:
    return "?" if value is None else f"{value * 100:.0f} %"


def _lasted(data: EventData) -> str:
    seconds = (data.t_ns - data.since_ns) // 1_000_000_000
    if seconds < 120:
        return f"{seconds} s"
    return f"{seconds // 60} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
