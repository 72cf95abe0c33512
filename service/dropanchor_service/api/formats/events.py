"""Events as CSV, piece by piece."""

from collections.abc import Iterable, Iterator
from typing import Any

from dropanchor_schemas.events import EventData
from dropanchor_service.api.formats.audit import line
from dropanchor_service.api.formats.figures import plain

_DATA = tuple(name for name in EventData.model_fields if name != "t_ns")
_OF_EVENT = ("sequence", "time", "type", "subject", "id")


def csv_lines(events: Iterable[Any]) -> Iterator[bytes]:
    """Yield a table with a column for each field of an event. Times are UTC."""
    yield line((*_OF_EVENT, *_DATA))
    for event in events:
        cells = (*(event[name] for name in _OF_EVENT), *(event["data"].get(name) for name in _DATA))
        yield line(plain(cell) if isinstance(cell, str) else cell for cell in cells)
