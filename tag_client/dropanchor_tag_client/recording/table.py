"""One table of a recording as columns of numbers, with the time as it stands in the file."""

import math
from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dropanchor_tag_client.recording.columns import FORMATS, TIMES, Columns
from dropanchor_tag_client.recording.csv_text import has_decimal_comma, import_hint
from dropanchor_tag_client.recording.recording import Place, RecordingError, Rows
from dropanchor_tag_client.recording.rows import Row, rows_of, unit_of


@dataclass
class Table:
    """The rows of one file, in the order of the file.

    time: name of the column that holds the time. t: the time of each row, in any unit. texts: of the text column.
    """

    file: Columns
    path: Path
    time: str = "t_s"
    t: "array[float]" = field(default_factory=lambda: array("d"))
    texts: list[str] = field(default_factory=list)
    values: dict[str, "array[float]"] = field(default_factory=dict)
    rows: Rows = field(default_factory=lambda: Rows("", "line", array("q")))

    def __len__(self) -> int:
        return len(self.rows.numbers)

    def take(self, order: list[int]) -> None:
        """Keep these rows, in this order."""
        self.t = array("d", map(self.t.__getitem__, order))
        self.texts = [self.texts[i] for i in order] if self.texts else []
        self.values = {name: array("d", map(column.__getitem__, order)) for name, column in self.values.items()}
        self.rows = self.rows._replace(numbers=array("q", map(self.rows.numbers.__getitem__, order)))


def read_table(folder: Path, file: Columns) -> Table:
    """Return the table, an empty one where an optional file is missing. Raises RecordingError."""
    path = next((p for p in (folder / f"{file.name}{ending}" for ending in FORMATS) if p.is_file()), None)
    table = Table(file, path or folder / f"{file.name}.csv", values={name: array("d") for name in file.numbers})
    if path is None:
        if file.is_required:
            raise RecordingError(f"{folder} has neither {file.name}.csv nor {file.name}.csv.gz, .jsonl or .parquet")
        return table
    table.rows = Rows(path.name, unit_of(path), array("q"))
    for number, row in rows_of(path, file):
        if not len(table) and file.interval_s is not None:
            table.time = next(name for name in TIMES if name in row)
        _add(table, number, row)
    return table


def _add(table: Table, number: int, row: Row) -> None:
    table.rows.numbers.append(number)
    where = Place(table.path, table.rows.unit, number)
    file = table.file
    for name, column in table.values.items():
        may_be_nan = name in file.optional or name in file.may_be_nan
        column.append(_number(row.get(name), name, where, may_be_nan))
    if file.interval_s is not None:
        t = _number(row.get(table.time), table.time, where, may_be_nan=False)
        if not math.isfinite(t):
            raise RecordingError(f"{where}: {table.time} is {row[table.time]!r}, a finite number was expected")
        table.t.append(t)
    if file.text:
        table.texts.append(_text(row.get(file.text), file.text, where))


def _number(value: Any, column: str, where: Place, may_be_nan: bool) -> float:
    """Return the number; NaN where it is missing and may be."""
    if value is None or value == "":
        if may_be_nan:
            return math.nan
        raise RecordingError(f"{where}: {column} is empty, a number was expected")
    if isinstance(value, str | int | float) and not isinstance(value, bool):
        try:
            return float(value)
        except (ValueError, OverflowError):
            pass
    text = f"{where}: {column} is {value!r}, a number was expected"
    if isinstance(value, str) and has_decimal_comma(value):
        raise RecordingError(f"{text}: it has a decimal comma. {import_hint(where.path.parent)}")
    raise RecordingError(text)


def _text(value: Any, column: str, where: Place) -> str:
    if value is None or value == "":
        raise RecordingError(f"{where}: {column} is empty")
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value)
