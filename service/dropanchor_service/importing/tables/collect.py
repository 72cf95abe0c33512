"""Collect the rows of a table into columns of numbers, by the fields that a mapping names."""

import math
from array import array
from collections.abc import Callable, Sequence
from typing import Any

from dropanchor_service.importing.readings import RANGE, LeftOut
from dropanchor_service.importing.tables.mapping import ANCHOR, OPTIONAL, T_NSEC, VECTORS, WIDE, Fields, T, quantity_of
from dropanchor_service.importing.tables.table import Exact, Table, exact_number, number, text_of
from dropanchor_service.importing.tables.times import bounded, iso_ns
from dropanchor_service.importing.tables.units import conversion

ONLY_ANCHOR = "1"
_BAD = "is not a number"

Cells = Sequence[Any]


class Kind:
    """The readings of one kind. rows: of the times. values: one array for each of its fields. anchors: of ranges."""

    def __init__(self, fields: Sequence[str]) -> None:
        self.fields = fields
        self.rows = array("q")
        self.values = {name: array("d") for name in fields}
        self.anchors: list[str] = []

    def add(self, row: int, values: Sequence[float], anchor: str | None = None) -> None:
        self.rows.append(row)
        for column, value in zip(self.values.values(), values, strict=True):
            column.append(value)
        if anchor is not None:
            self.anchors.append(anchor)


class Collected:
    """The readings of a table, by quantity. times: as they stand in the table, ns where they are ISO 8601. lines: of
    the rows. iso: the times are ISO 8601; zoneless: some of them without a zone."""

    def __init__(self, fields: Fields) -> None:
        self.times: list[Exact] = []
        self.seconds: list[int] = []
        self.lines: list[int] = []
        self.iso = self.zoneless = False
        self.vectors = {
            quantity: Kind((*names, *OPTIONAL.get(quantity, ())))
            for quantity, names in VECTORS.items()
            if names[0] in fields
        }
        self.ranges = Kind(("range", "std"))
        self.headings = Kind(("heading", "heading_std"))
        self.held = 0


def collected(table: Table, fields: Fields, left_out: LeftOut) -> Collected:
    """Return the readings of the table, in SI units except the times."""
    return _Collector(table, fields, left_out).collected()


class _Collector:
    def __init__(self, table: Table, fields: Fields, left_out: LeftOut) -> None:
        self._table, self._left_out = table, left_out
        self._fields = fields
        self._index = {name: table.columns.index(column.name) for name, column in fields.items()}
        self._scale = {name: _scale(fields, name) for name in fields}
        self._out = Collected(fields)
        self._ranges = [name for name in fields if name == RANGE or name.startswith(WIDE)]
        self._last: dict[str, float] = {}

    def collected(self) -> Collected:
        is_mixed = bool(self._out.vectors) and bool(self._ranges)
        for line, cells in self._table.rows(self._left_out):
            if not self._take_time(cells, line):
                continue
            row = len(self._out.lines) - 1
            for quantity, kind in self._out.vectors.items():
                self._take_vector(quantity, kind, cells, row)
            self._take_ranges(cells, row, is_mixed)
            self._take_heading(cells, row)
        return self._out

    def _take_time(self, cells: Cells, line: int) -> bool:
        cell = cells[self._index[T]]
        try:
            found = exact_number(cell)
        except (ValueError, TypeError):
            moment = iso_ns(cell) if isinstance(cell, str) else None
            if moment is None:
                self._left_out.add(self._table.name, f"the time {_BAD}", line)
                return False
            self._out.iso, self._out.zoneless = True, self._out.zoneless or not moment[1]
            found = moment[0]
        if found is None:
            self._left_out.add(self._table.name, "there is no time", line)
            return False
        self._out.times.append(found)
        self._out.lines.append(line)
        if T_NSEC in self._index:
            self._out.seconds.append(bounded(number(cells[self._index[T_NSEC]]) or 0))
        return True

    def _take_vector(self, quantity: str, kind: Kind, cells: Cells, row: int) -> None:
        values = [self._number(name, cells, row) for name in kind.fields]
        needed = values[: len(VECTORS[quantity])]
        if None not in needed:
            kind.add(row, [math.nan if value is None else value for value in values])
        elif any(value is not None for value in needed):
            self._left_out.add(self._table.name, f"{quantity} lacks an axis", self._out.lines[row])

    def _take_ranges(self, cells: Cells, row: int, is_mixed: bool) -> None:
        for name in self._ranges:
            value = self._number(name, cells, row)
            if value is None:
                continue
            anchor = name.removeprefix(WIDE) if name != RANGE else self._anchor(cells)
            if value < 0.0:
                self._left_out.add(self._table.name, "the range is below zero", self._out.lines[row])
            elif not anchor:
                self._left_out.add(self._table.name, "the range has no anchor", self._out.lines[row])
            elif is_mixed and self._last.get(anchor) == value:
                self._out.held += 1
            else:
                self._last[anchor] = value
                std = self._number("std", cells, row)
                self._out.ranges.add(row, (value, std if std is not None else float("nan")), anchor)

    def _take_heading(self, cells: Cells, row: int) -> None:
        value = self._number("heading", cells, row) if "heading" in self._index else None
        if value is not None:
            std = self._number("heading_std", cells, row)
            self._out.headings.add(row, (value, std if std is not None else float("nan")))

    def _anchor(self, cells: Cells) -> str:
        return text_of(cells[self._index[ANCHOR]]) if ANCHOR in self._index else ONLY_ANCHOR

    def _number(self, name: str, cells: Cells, row: int) -> float | None:
        """Return a value in SI, None where there is none. Count one that is no number."""
        index = self._index.get(name)
        if index is None:
            return None
        try:
            value = number(cells[index])
        except (ValueError, TypeError):
            self._left_out.add(self._table.name, f"{name} {_BAD}", self._out.lines[row])
            return None
        return None if value is None else self._scale[name](value)


def _scale(fields: Fields, name: str) -> Callable[[float], float]:
    """Return the function from a column's unit to SI."""
    quantity, column = quantity_of(name), fields[name]
    if quantity is None or column.unit is None or name == T:
        return (lambda value: -value) if column.sign < 0 else (lambda value: value)
    factor, offset = conversion(column.unit, quantity).factor * column.sign, conversion(column.unit, quantity).offset
    if name.endswith("std"):
        return lambda value: abs(factor) * value
    return lambda value: factor * value + offset
