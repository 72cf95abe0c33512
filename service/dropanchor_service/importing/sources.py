"""Find out what a source is, and read it."""

from collections.abc import Sequence
from pathlib import Path

from dropanchor_service.importing.choice import Choice, Found
from dropanchor_service.importing.files import File, files_of, first_bytes
from dropanchor_service.importing.join import merged
from dropanchor_service.importing.phones import phyphox, sensor_logger
from dropanchor_service.importing.readings import ImportingError, Readings
from dropanchor_service.importing.tables.json_table import JsonTable, read_json
from dropanchor_service.importing.tables.mapping import ColumnMap, column_text
from dropanchor_service.importing.tables.reading import fields_of, is_useful, positions, readings_of
from dropanchor_service.importing.tables.text_table import TextTable, read_table

TEXT = (".csv", ".tsv", ".txt", ".dat", ".log")
JSON = (".json", ".jsonl", ".ndjson")
_MCAP, _ROS1, _SQLITE = b"\x89MCAP0\r\n", b"#ROSBAG V2.0", b"SQLite format 3\0"


def read_source(path: Path, choice: Choice) -> Found:
    """Return what a source holds. Raises ImportingError."""
    if _is_bag(path):
        from dropanchor_service.importing.bags.reading import read_bag

        return read_bag(path, choice)
    files = files_of(path)
    tables = [(file, table) for file in files if (table := _table(file, len(files) == 1)) is not None]
    columns = [table.columns for _, table in tables]
    if any(map(sensor_logger.is_export, columns)):
        return Found(sensor_logger.read_export(files, path.name, choice.signs))
    if any(map(phyphox.is_export, columns)) and not choice.columns:
        return Found(phyphox.read_export(files, path.name))
    if not tables:
        raise ImportingError(
            f"{path}: {_kinds(files)}. A source is a bag of ROS, an MCAP file, an export of Sensor Logger or phyphox, "
            "or tables (CSV, TSV, JSON, JSON Lines)"
        )
    return _of_tables(path, [table for _, table in tables], choice.columns)


def _is_bag(path: Path) -> bool:
    if path.is_dir():
        return (path / "metadata.yaml").is_file() or any(path.glob("*.mcap")) or any(path.glob("*.db3"))
    if not path.exists():
        raise ImportingError(f"{path} does not exist")
    return first_bytes(path, 16).startswith((_MCAP, _ROS1, _SQLITE))


def _table(file: File, is_only: bool) -> TextTable | JsonTable | None:
    """Return the table of a file by its name; the only file of a source may have any name."""
    name = file.name.lower().removesuffix(".gz")
    if name.endswith(JSON):
        return read_json(file)
    if not name.endswith(TEXT) and not is_only:
        return None
    with file.opened() as raw:
        head = raw.read(512)
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


def _of_tables(path: Path, tables: Sequence[TextTable | JsonTable], columns: ColumnMap) -> Found:
    parts: list[tuple[str, Readings]] = []
    found = Found(Readings())
    for table in tables:
        fields = fields_of(table, columns.texts_for(table.name))
        if is_useful(fields):
            parts.append((table.name, readings_of(table, fields)))
            (found.fields if columns else found.guessed)[table.name] = fields
        else:
            placed = positions(table, Readings().left_out)
            parts.append((table.name, placed or _unused(table)))
    if all(part.is_empty for _, part in parts):
        raise ImportingError(_no_column(path, tables, columns))
    found.readings = merged(parts)
    return found


def _unused(table: TextTable | JsonTable) -> Readings:
    return Readings(
        notes=[f"{table.name}: not used: its columns {', '.join(table.columns[:12])} hold no known reading"]
    )


def _no_column(path: Path, tables: Sequence[TextTable | JsonTable], columns: ColumnMap) -> str:
    names = "; ".join(f"{table.name} has {', '.join(table.columns[:20])}" for table in tables[:5])
    if columns:
        wanted = sorted({column_text(text) for table in tables for text in columns.texts_for(table.name).values()})
        return f"{path}: --map names no time with a reading that is there ({', '.join(wanted)}): {names}"
    return (
        f"{path}: no column is known as a time with a range, or with three axes of an IMU: {names}. Say what they are: "
        "--map t=COLUMN:ms range=COLUMN:cm anchor=COLUMN ax=COLUMN:g ay=… (dropanchor import --help)"
    )


def _kinds(files: Sequence[File]) -> str:
    names = [file.name for file in files]
    return f"{', '.join(names[:5])}{', …' if len(names) > 5 else ''} cannot be read"


def check_used(columns: ColumnMap, founds: Sequence[Found]) -> None:
    """Raise ImportingError for a field of the mapping that no source has."""
    used = {name for found in founds for fields in found.fields.values() for name in fields}
    told = set(columns.general) | {name for table in columns.of_source.values() for name in table}
    if founds and (missing := sorted(told - used)):
        texts = columns.general | {name: text for table in columns.of_source.values() for name, text in table.items()}
        lacking = ", ".join(f"{name}={texts[name]}" for name in missing)
        raise ImportingError(f"--map {lacking}: no source has such a column")
