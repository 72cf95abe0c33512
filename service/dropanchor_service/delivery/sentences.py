"""Events as sentences for people."""

from collections.abc import Callable
from urllib.parse import urlencode

from dropanchor_schemas.events import Event, EventData
from dropanchor_service.delivery.words import Words
from dropanchor_service.events.store import rfc3339

SOURCE_PREFIX = "urn:dropanchor:site:"
NameOf = Callable[[str], str]
"""Returns how people call a tag."""
ZoneOf = Callable[[], str | None]
"""Returns the time zone of a site."""

_AROUND_NS = 300_000_000_000  # of the past that a link shows, before and after the event


def sentence(event: Event, name_of: NameOf, words: Words) -> str:
    """Return what happened in one line, such as `Cart 3 (cart-3) entered Loading dock`."""
    data, charge = event.data, event.data.battery_fraction
    reason, before = data.reason, data.retracted_type or data.alarm_type
    values = {
        "tag": name_of(event.subject),
        "other": "" if data.other_tag is None else name_of(data.other_tag),
        "place": _place(data),
        "time": _lasted(data, words),
        "speed": _measure(data.speed_mps, 1, "m/s", words),
        "distance": _measure(data.distance_m, 1, "m", words),
        "battery": _measure(None if charge is None else charge * 100, 0, "%", words),
        "before": "" if before is None else words.texts[f"kind.{before}"],
        "why": "" if reason is None else words.texts[f"event.why.{reason}"],
        "who": f"({data.acknowledged_by})" if data.acknowledged_by else "",
        "note": data.note or "",
    }
    return " ".join(words.texts[f"event.{event.type}"].format(**values).split())


def kind(event: Event, words: Words) -> str:
    """Return what events of several tags have in common, such as `Entered a zone: Loading dock`."""
    return f"{words.texts[f'kind.{event.type}']}: {_place(event.data)}"


def place_and_time(event: Event, words: Words) -> str:
    """Return when, where and how surely it happened, such as `…; x 3.2 m, y 1.7 m; probability 0.99`."""
    data = event.data
    place = [_measure(value, 1, "m", words) for value in (data.x, data.y)]
    where = [] if data.x is None else [f"x {place[0]}, y {place[1]}"]
    floor = None if data.probability is None else int(data.probability * 100) / 100
    sure = [] if floor is None else [f"{words.texts['mail.probability']} {words.number(floor, 2)}"]
    return "; ".join([words.time(data.t_ns), *where, *sure])


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


def _measure(value: float | None, decimals: int, unit: str, words: Words) -> str:
    return "?" if value is None else f"{words.number(value, decimals)} {unit}"


def _lasted(data: EventData, words: Words) -> str:
    seconds = (data.t_ns - data.since_ns) // 1_000_000_000
    if seconds < 120:
        return f"{seconds} s"
    return f"{seconds // 60} min" if seconds < 7200 else f"{words.number(seconds / 3600, 1)} h"
