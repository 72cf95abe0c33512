"""Yield the rows of a table with their numbers in the file, from CSV, JSON lines or Parquet."""

import csv
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from dropanchor_tag_client.recording.bounded import require_plausible
from dropanchor_tag_client.recording.columns import TIMES, Columns
from dropanchor_tag_client.recording.csv_text import import_hint, lines_of_text, why_not_ours
from dropanchor_tag_client.recording.recording import Place, RecordingError

Row = Mapping[str, Any]


def rows_of(path: Path, file: Columns) -> Iterator[tuple[int, Row]]:
    """Yield number and values of each row. Raises RecordingError, also where a column is missing in all rows."""
    if path.suffix == ".parquet":
        return _parquet_rows(path, file)
    if ".jsonl" in path.suffixes:
        return _json_rows(path, file)
    return _csv_rows(path, file)


def unit_of(path: Path) -> str:
    return "row" if path.suffix == ".parquet" else "line"


def _needed(file: Columns) -> set[str]:
    return {*file.numbers, *([file.text] if file.text else [])} - set(file.optional)


def _check(where: Place, file: Columns, names: set[str], header: str = "") -> None:
    """Raise RecordingError if a column is missing."""
    missing = sorted(_needed(file) - names)
    if file.interval_s is not None and not names & set(TIMES):
        missing.append("t_s (or t_ms, t_us, t_ns)")
    if not missing:
        return
    cause = why_not_ours(header, _needed(file))
    if cause is not None:
        raise RecordingError(f"{where}: {cause}. {import_hint(where.path.parent)}")
    there = ", ".join(sorted(name for name in names if name)[:20]) or "none"
    raise RecordingError(f"{where}: the columns {', '.join(missing)} are missing; there are: {there}")


def _csv_rows(path: Path, file: Columns) -> Iterator[tuple[int, Row]]:
    """Skip empty lines and those that begin with #."""
    reader = csv.reader(lines_of_text(path), skipinitialspace=True)
    names: list[str] | None = None
    try:
        for values in reader:
            if not any(values) or values[0].startswith("#"):
                continue
            if names is None:
                names = [name.strip() for name in values]
                _check(Place(path, "line", reader.line_num), file, set(names), ",".join(values))
            elif len(values) != len(names):
                raise RecordingError(f"{path} line {reader.line_num}: {len(names)} values were expected")
            else:
                yield reader.line_num, dict(zip(names, values, strict=True))
    except csv.Error as error:
        raise RecordingError(f"{path} line {reader.line_num} cannot be read: {error}") from error
    if names is None:
        raise RecordingError(f"{path} is empty: its first line must name the columns")


def _json_rows(path: Path, file: Columns) -> Iterator[tuple[int, Row]]:
    is_checked = False
    for number, line in enumerate(lines_of_text(path), start=1):
        if not line.strip():
            continue
        try:
            row = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise RecordingError(f"{path} line {number} is not JSON: {error}") from error
        if not isinstance(row, dict):
            raise RecordingError(f"{path} line {number}: a JSON object was expected, one per line")
        if not is_checked:
            _check(Place(path, "line", number), file, set(row))
            is_checked = True
        yield number, row


def _parquet_rows(path: Path, file: Columns) -> Iterator[tuple[int, Row]]:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ModuleNotFoundError as error:
        raise RecordingError(
            f"{path}: Parquet needs the extra `parquet`: pip install 'dropanchor-service[parquet]'"
        ) from error
    try:
        source = pq.ParquetFile(path)
        require_plausible(path, path.stat().st_size, 8 * source.metadata.num_rows * len(source.schema_arrow))
        table = source.read()
    except (OSError, pa.ArrowException) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error
    names = [name for name in table.column_names if name in {*file.numbers, file.text, *TIMES}]
    _check(Place(path, "row", 1), file, set(table.column_names))
    columns: dict[str, list[Any]] = {}
    for name in names:
        column = table[name]
        if pa.types.is_timestamp(column.type) and name in TIMES:
            name, column = "t_ns", column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64())
        columns[name] = column.to_pylist()
    for number, values in enumerate(zip(*columns.values(), strict=True), start=1):
        yield number, dict(zip(columns, values, strict=True))
