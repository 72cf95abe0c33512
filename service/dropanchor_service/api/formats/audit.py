"""The trail of changes as CSV and as JSON lines, piece by piece."""

import csv
import io
from collections.abc import Iterable, Iterator
from typing import Any

from dropanchor_service.answers.answers import to_json
from dropanchor_service.answers.times import iso_utc
from dropanchor_service.api.formats.figures import plain

COLUMNS = ("number", "time_utc", "source", "by", "kind", "item", "before", "after", "confirmed")


def json_lines(entries: Iterable[dict[str, Any]]) -> Iterator[bytes]:
    """Yield an `AuditEntry` for each line."""
    for entry in entries:
        yield to_json(entry) + b"\n"


def csv_lines(entries: Iterable[dict[str, Any]]) -> Iterator[bytes]:
    """Yield a table with what was before and after as JSON."""
    yield line(COLUMNS)
    for entry in entries:
        who = (entry["by"]["source"], plain(entry["by"]["name"]))
        values = (to_json(entry[name]).decode() for name in ("before", "after"))
        what = (entry["kind"], plain(entry["item"]), *values)
        yield line((entry["number"], iso_utc(entry["t_ns"]), *who, *what, entry["confirmed"]))


def line(cells: Iterable[Any]) -> bytes:
    """Return one line of a CSV file."""
    text = io.StringIO(newline="")
    csv.writer(text).writerow(cells)
    return text.getvalue().encode()
