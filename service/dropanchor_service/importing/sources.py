"""Find out what a source is, and read it."""

from collections.abc import Sequence
from pathlib import Path

from dropanchor_service.importing.binaries import HEAD_BYTES, archive_known_as, known_as
from dropanchor_service.importing.choice import Choice, Found
from dropanchor_service.importing.files import File, files_of, first_bytes
from dropanchor_service.importing.join import merged
from dropanchor_service.importing.phones import phyphox, sensor_logger
from dropanchor_service.importing.readings import ImportingError, Readings
from dropanchor_service.importing.tables.json_table import JsonTable, read_json
from dropanchor_service.importing.tables.mapping import ColumnMap, column_text
from dropanchor_service.importing.tables.parquet_table import ParquetTable, read_parquet
from dropanchor_service.importing.tables.reading import (
    fields_of,
    is_useful,
    positions,
    readings_of,
    told_of,
    why_unused,
)
from dropanchor_service.importing.tables.text_table import TextTable, read_table

AnyTable = TextTable | JsonTable | ParquetTable
PARQUET = (".parquet", ".pq")
TEXT = (".csv", ".tsv", ".txt", ".dat", ".log")
JSON = (".json", ".jsonl", ".ndjson")
_MCAP, _ROS1, _SQLITE = b"\x89MCAP0\r\n", b"#ROSBAG V2.0", b"SQLite format 3\0"


def read_source(path: Path, choice: Choice) -> Found:
    """Return what a source holds. Raises ImportingError."""
    if _is_bag(path):
        from dropanchor_service.importing.bags.reading import read_bag

        return read_bag(path, choice)
    files = files_of(path)
    if (known := archive_known_as([file.name for file in files])) is not None:
        raise ImportingError(f"{path} is not read: {known}")
    tables = [(file, table) for file in files if (table := _table(file, len(files) == 1)) is not None]
    columns, name = [table.columns for _, table in tables], path.resolve().name  # that of `.`, too
    if any(map(sensor_logger.is_export, columns)):
        return Found(sensor_logger.read_export(files, name, choice.signs))
    if any(map(phyphox.is_export, columns)) and not choice.columns:
        return Found(phyphox.read_export(files, name))
    if not tables:
        raise ImportingError(
            f"{path}: {_kinds(files)}. A source is a bag of ROS, an MCAP file, an export of Sensor Logger or phyphox, "
            "or tables (CSV, TSV, JSON, JSON Lines, Parquet)"
        )
    found = _of_tables(path, [table for _, table in tables], choice.columns)
    read = {file.name for file, _ in tables}
    found.readings.notes += [_not_read(file) for file in files if file.name not in read]
    return found


def _is_bag(path: Path) -> bool:
    if path.is_dir():
        return (path / "metadata.yaml").is_file() or any(path.glob("*.mcap")) or any(path.glob("*.db3"))
    if not path.exists():
        raise ImportingError(f"{path} does not exist")
    return first_bytes(path, 16).startswith((_MCAP, _ROS1, _SQLITE))


def _table(file: File, is_only: bool) -> AnyTable | None:
    """Return the table of a file by its name; the only file of a source may have any name."""
    name = file.name.lower().removesuffix(".gz")
    if name.endswith(JSON):
        return read_json(file)
    if name.endswith(PARQUET):
        return read_parquet(file)
    if not name.endswith(TEXT) and not is_only:
        return None
    with file.opened() as raw:
        head = raw.read(HEAD_BYTES)
    if is_only and known_as(head) is not None:
        return None
    if head.lstrip(b"\xef\xbb\xbf \r\n").startswith(b"{"):
        return read_json(file)
    if not name.endswith(TEXT) and b"\0\0\0\0" in head:
        return None
    try:
        return read_table(file)
    except ImportingError:
        if is_only:
            raise
        return None


def _of_tables(path: Path, tables: Sequence[AnyTable], columns: ColumnMap) -> Found:
    parts: list[tuple[str, Readings]] = []
    found = Found(Readings())
    for table in tables:
        texts = columns.texts_for(table.name)
        fields, told = fields_of(table, texts), told_of(table, texts)
        found.told |= {name for name, text in texts.items() if name in told or not text}
        if is_useful(fields):
            parts.append((table.name, readings_of(table, fields)))
            found.fields[table.name] = fields
            if set(fields) - set(told):
                found.guessed[table.name] = fields
        else:
            placed = positions(table, Readings().left_out)
            parts.append((table.name, placed or Readings(notes=[why_unused(table, fields)])))
    if all(part.is_empty for _, part in parts):
        advice = [note for _, part in parts for note in part.notes if "--map" in note]
        raise ImportingError(". ".join([_no_column(path, tables, columns), *advice]))
    found.readings = merged(parts)
    return found


def _no_column(path: Path, tables: Sequence[AnyTable], columns: ColumnMap) -> str:
    names = "; ".join(f"{table.name} has {', '.join(table.columns[:20])}" for table in tables[:5])
    if columns:
        wanted = sorted({column_text(text) for table in tables for text in columns.texts_for(table.name).values()})
        return f"{path}: --map names no time with a reading that is there ({', '.join(wanted)}): {names}"
    return (
        f"{path}: no column is known as a time with a range, or with three axes of an IMU: {names}. Say what they are: "
        "--map t=COLUMN:ms range=COLUMN:cm anchor=COLUMN ax=COLUMN:g ay=… (dropanchor import --help)"
    )


def _kinds(files: Sequence[File]) -> str:
    return "; ".join(_not_read(file) for file in files[:5]) + ("; …" if len(files) > 5 else "")


def _not_read(file: File) -> str:
    """Return that a file is not read, and what it is if that is known."""
    with file.opened() as raw:
        known = known_as(raw.read(HEAD_BYTES))
    return f"{file.name} is not read" + (f": {known}" if known else "")


def check_used(columns: ColumnMap, founds: Sequence[Found]) -> None:
    """Raise ImportingError for a field of the mapping that no source has."""
    used = {name for found in founds for name in found.told}
    told = set(columns.general) | {name for table in columns.of_source.values() for name in table}
    if founds and (missing := sorted(told - used)):
        texts = columns.general | {name: text for table in columns.of_source.values() for name, text in table.items()}
        lacking = ", ".join(f"{name}={texts[name]}" for name in missing)
        raise ImportingError(f"--map {lacking}: no source has such a column")
