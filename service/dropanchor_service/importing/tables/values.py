"""Decide by the values of a table what the names of its columns leave open: the time, and who is at the other end."""

import re
from collections.abc import Sequence
from itertools import islice
from typing import Any

import numpy as np

from dropanchor_service.importing.readings import RANGE, ImportingError, LeftOut
from dropanchor_service.importing.tables.guess import guessed, words_of_name
from dropanchor_service.importing.tables.mapping import ANCHOR, Column, T
from dropanchor_service.importing.tables.table import Table, number, text_of
from dropanchor_service.importing.tables.times import iso_ns

_SAMPLE = 500
_MIN_TREND = 0.9  # correlation of a time with its row
_MAX_IDS = 64
_SURE = {"anchor", "anchors", "anchorid", "beacon", "beaconid", "anc"}
_FAR = {"to", "dst", "dest", "destination", "peer", "target", "responder", "remote"}
_NEAR = {"from", "src", "source", "initiator", "local", "tag"}
_IDS = {"id", "mac", "addr", "address", "node", "device", "short", "uwb", "name"} | _FAR | _NEAR
_COUNTERS = {"counter", "count", "packet", "frame", "index", "seq", "sequence", "sample", "samples", "row"}
_SHORT_ID = re.compile(r"(?:[a-z]{1,2}|uwb|anchor|anc|beacon)[ _-]?\d{1,3}", re.IGNORECASE)
_REACH_M = 300.0


class Sampled:
    """The first rows of a table, by column."""

    def __init__(self, table: Table) -> None:
        self.table = table
        self._rows = [cells for _, cells in islice(table.rows(LeftOut()), _SAMPLE)]

    def __len__(self) -> int:
        return len(self._rows)

    def cells(self, column: str) -> list[Any]:
        place = list(self.table.columns).index(column)
        return [row[place] for row in self._rows]

    def numbers(self, column: str) -> list[float]:
        """Return its numbers and dates; nothing for what is neither."""
        return [value for cell in self.cells(column) if (value := _value(cell)) is not None]


def decided(sampled: Sampled, taken: Sequence[str] = ()) -> dict[str, Column]:
    """Return the columns by field, by names and values. taken: columns that are spoken for. Raises ImportingError."""
    columns = [name for name in sampled.table.columns if name not in taken]
    fields = _timed(sampled, columns)
    if RANGE in fields:
        fields = {name: column for name, column in fields.items() if name != ANCHOR} | _anchor(
            sampled, columns, fields.get(ANCHOR)
        )
    return fields


def _timed(sampled: Sampled, columns: Sequence[str]) -> dict[str, Column]:
    """Return the fields whose time runs forward, or else the first whose time may have been set on the way."""
    refused: list[str] = []
    first: dict[str, Column] | None = None
    while True:
        fields = guessed([name for name in columns if name not in refused], sampled.table.name)
        if T not in fields:
            return fields if first is None else first
        values = sampled.numbers(fields[T].name)
        if not len(sampled) or _runs_forward(values):
            return fields
        if values and fields[T].name != "T":  # a temperature
            first = first or fields
        refused.append(fields[T].name)


def _runs_forward(values: Sequence[float]) -> bool:
    if len(values) < 3:
        return bool(values)
    if min(values) == max(values):
        return False
    return float(np.corrcoef(np.arange(len(values)), np.asarray(values))[0, 1]) > _MIN_TREND


def _anchor(sampled: Sampled, columns: Sequence[str], guess: Column | None) -> dict[str, Column]:
    """Return the column that names the anchor: of two ids that one that changes, for the tag is one and the same."""
    words = {name: set(words_of_name(name)) for name in columns}
    ids = [name for name in columns if words[name] and words[name] <= _IDS and words[name] != {"uwb"}]
    seen = {name: {text for cell in sampled.cells(name) if (text := text_of(cell))} for name in ids}
    changing = [name for name in ids if 2 <= len(seen[name]) <= min(_MAX_IDS, max(2, len(sampled) // 2))]
    if tags := [name for name in changing if "tag" in words[name]]:
        raise ImportingError(
            f"{sampled.table.name} has ranges of {len(seen[tags[0]])} tags ({tags[0]}: {_some(seen[tags[0]])}): a "
            "recording is of one. Import the rows of each tag alone"
        )
    if guess is not None and _SURE & set(words_of_name(guess.name)):
        return {ANCHOR: guess}
    if len(changing) > 1 and not _are_one(sampled, changing):
        raise ImportingError(
            f"{sampled.table.name}: {' and '.join(changing)} take several values each: neither is the only tag. "
            f"Import the rows of each tag alone, and say which column is the anchor: --map anchor={changing[-1]}"
        )
    constant = [name for name in ids if len(seen[name]) == 1]
    far = [name for name in constant if _FAR & words[name]] if len(constant) > 1 else []
    named = guess.name if guess is not None and seen.get(guess.name) and guess.name in constant else None
    chosen = next(iter(changing or far), named)
    return {} if chosen is None else {ANCHOR: Column(chosen)}


def _are_one(sampled: Sampled, names: Sequence[str]) -> bool:
    """Return whether these columns are names of the same."""
    rows = set(zip(*(map(text_of, sampled.cells(name)) for name in names), strict=True))
    return all(len({row[place] for row in rows}) == len(rows) for place in range(len(names)))


def counter_of(sampled: Sampled) -> str | None:
    """Return the column that counts the rows, if there is one."""
    for name in sampled.table.columns:
        if _COUNTERS & set(words_of_name(name)) and _runs_forward(sampled.numbers(name)):
            return name
    return None


def may_be_ranges(sampled: Sampled, names: Sequence[str]) -> list[str]:
    """Return the columns that are called like an anchor, and hold what may be its ranges in m."""
    found = {name: sampled.numbers(name) for name in names if _SHORT_ID.fullmatch(name)}
    has_ranges = any(0.0 < value < _REACH_M and value != int(value) for values in found.values() for value in values)
    return list(found) if has_ranges else []


def _some(values: set[str]) -> str:
    return ", ".join(sorted(values)[:4]) + (", …" if len(values) > 4 else "")


def _value(cell: Any) -> float | None:
    try:
        return number(cell)
    except (ValueError, TypeError):
        moment = iso_ns(cell) if isinstance(cell, str) else None
        return None if moment is None else float(moment[0])
