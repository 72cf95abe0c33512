"""The figures of tags as CSV: one line for each tag, one column for each zone."""

import csv
import io
import math
from typing import Any

from dropanchor_service.answers.times import iso_utc

FIGURES = ("poses", "tracked_s", "distance_m", "mean_speed_mps", "max_speed_mps")
_FORMULA = ("=", "+", "-", "@")


def figures_csv(figures: dict[str, Any]) -> bytes:
    """Return the `Figures` as a table."""
    zones = [zone["zone"] for zone in figures["zones"]]
    period = [iso_utc(figures["from_ns"]), iso_utc(figures["to_ns"])]
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(["tag", "from_utc", "to_utc", *FIGURES, *(f"in {zone} s" for zone in zones)])
    for tag in figures["tags"]:
        inside = {time["zone"]: time["inside_s"] for time in tag["zones"]}
        numbers = [_number(tag[name]) for name in FIGURES]
        writer.writerow([plain(tag["tag"]), *period, *numbers, *(inside.get(zone, 0) for zone in zones)])
    return text.getvalue().encode()


def _number(value: float | None) -> float | str:
    """Return a number, and an empty cell for one that is unknown."""
    return "" if value is None or not math.isfinite(value) else value


def plain(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula."""
    return f"'{text}" if text.startswith(_FORMULA) else text
