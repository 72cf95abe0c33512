"""Events as sentences for people."""

from collections.abc import Callable
from datetime import UTC, datetime
from urllib.parse import urlencode

from dropanchor_schemas.events import Event, EventData, EventType
from dropanchor_service.delivery.words import Words
from dropanchor_service.events.store import rfc3339

SOURCE_PREFIX = "urn:dropanchor:site:"
NameOf = Callable[[str], str]
"""Returns how people call a tag."""

_AROUND_NS = 300_000_000_000  # of the past that a link shows, before and after the event


def sentence(event: Event, name_of: NameOf, words: Words) -> str:
    """Return what happened in one line, such as `Cart 3 (cart-3) entered Loading dock`."""
    data = event.data
    other = "" if data.other_tag is None else name_of(data.other_tag)
    values = {"tag": name_of(event.subject), "other": other, "place": _place(data)}
    values |= {"number": _number(event, words), "lasted": _lasted(data, words), "before": _before(data, words)}
    values["why"] = "" if data.reason is None else words.reasons[data.reason]
    values |= {"who": f"({data.acknowledged_by})" if data.acknowledged_by else "", "note": data.note or ""}
    return " ".join(words.sentences[event.type].format(**values).split())


def kind(event: Event, words: Words) -> str:
    """Return what events of several tags have in common, such as `entered Loading dock`."""
    text = words.kinds[event.type].format(place=_place(event.data), before=_before(event.data, words))
    return " ".join(text.split())


def place_and_time(event: Event, words: Words) -> str:
    """Return when, where and how surely it happened, such as `…; x 3.2 m, y 1.7 m; probability 0.99`."""
    data = event.data
    place = [_metres(value, words) for value in (data.x, data.y)]
    where = [] if data.x is None else [f"x {place[0]}, y {place[1]}"]
    floor = None if data.probability is None else int(data.probability * 100) / 100
    sure = [] if floor is None else [f"{words.probability} {words.number(floor, 2)}"]
    return "; ".join([words.time(datetime.fromtimestamp(data.t_ns / 1e9, UTC).astimezone()), *where, *sure])


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


def _before(data: EventData, words: Words) -> str:
    """Return the kind of the event that this one is about."""
    before = data.retracted_type or data.alarm_type
    return "" if before is None else words.kinds[before].format(place=_place(data))


def _metres(value: float | None, words: Words) -> str:
    return "?" if value is None else f"{words.number(value, 1)} m"


def _number(event: Event, words: Words) -> str:
    """Return the speed in m/s, the distance in m or the charge in percent that the event is about."""
    data = event.data
    charge = None if data.battery_fraction is None else data.battery_fraction * 100
    if event.type == EventType.TAG_BATTERY_LOW:
        return "?" if charge is None else words.number(charge, 0)
    value = data.speed_mps if event.type == EventType.ZONE_SPEED else data.distance_m
    return "?" if value is None else words.number(value, 1)


def _lasted(data: EventData, words: Words) -> str:
    seconds = (data.t_ns - data.since_ns) // 1_000_000_000
    if seconds < 120:
        return f"{seconds} s"
    return f"{seconds // 60} min" if seconds < 7200 else f"{words.number(seconds / 3600, 1)} h"
