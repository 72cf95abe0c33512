"""Figures, events and the trail of changes as CSV, line by line."""

import csv
import io
import math
from collections.abc import Iterable, Iterator
from typing import Any

from dropanchor_schemas.events import EventData
from dropanchor_service.answers.answers import to_json
from dropanchor_service.answers.times import iso_utc

FIGURES = ("poses", "tracked_s", "distance_m", "mean_speed_mps", "max_speed_mps")
_FORMULA = ("=", "+", "-", "@")
_EVENT = ("sequence", "time", "type", "subject", "id")
_DATA = tuple(name for name in EventData.model_fields if name != "t_ns")
_CHANGE = ("number", "time_utc", "source", "by", "kind", "item", "before", "after", "confirmed")


def figures_csv(figures: dict[str, Any]) -> bytes:
    """Return the `Figures` as a table: one line for each tag, one column for each zone."""
    zones = [zone["zone"] for zone in figures["zones"]]
    period = [iso_utc(figures["from_ns"]), iso_utc(figures["to_ns"])]
    lines = [_line(["tag", "from_utc", "to_utc", *FIGURES, *(f"in {zone} s" for zone in zones)])]
    for tag in figures["tags"]:
        inside = {time["zone"]: time["inside_s"] for time in tag["zones"]}
        numbers = [_number(tag[name]) for name in FIGURES]
        lines.append(_line([_plain(tag["tag"]), *period, *numbers, *(inside.get(zone, 0) for zone in zones)]))
    return b"".join(lines)


def events_csv(events: Iterable[Any]) -> Iterator[bytes]:
    """Yield a table with a column for each field of an event. Times are UTC."""
    yield _line((*_EVENT, *_DATA))
    for event in events:
        cells = (*(event[name] for name in _EVENT), *(event["data"].get(name) for name in _DATA))
        yield _line(_plain(cell) if isinstance(cell, str) else cell for cell in cells)


def changes_csv(entries: Iterable[dict[str, Any]]) -> Iterator[bytes]:
    """Yield a table of `AuditEntry`, with what was before and after as JSON."""
    yield _line(_CHANGE)
    for entry in entries:
        who = (entry["by"]["source"], _plain(entry["by"]["name"]))
        values = (to_json(entry[name]).decode() for name in ("before", "after"))
        what = (entry["kind"], _plain(entry["item"]), *values)
        yield _line((entry["number"], iso_utc(entry["t_ns"]), *who, *what, entry["confirmed"]))


def _line(cells: Iterable[Any]) -> bytes:
    text = io.StringIO(newline="")
    csv.writer(text).writerow(cells)
    return text.getvalue().encode()


def _number(value: float | None) -> float | str:
    """Return a number, and an empty cell for one that is unknown."""
    return "" if value is None or not math.isfinite(value) else value


def _plain(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula."""
    return f"'{text}" if text.startswith(_FORMULA) else text
