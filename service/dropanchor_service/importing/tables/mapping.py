"""Which column of a table holds which field, and its unit: `--map` and its file."""

import re
import shlex
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from dropanchor_service.importing.readings import ACC, GYRO, HEADING, MAG, PRESSURE, RANGE, TIME, TRUTH, ImportingError
from dropanchor_service.importing.tables.units import conversion
from dropanchor_tag_client.command_line import did_you_mean

T, T_NSEC, ANCHOR = "t", "t_nsec", "anchor"
WIDE = "range."
_AXES = {ACC: ("ax", "ay", "az"), GYRO: ("gx", "gy", "gz"), MAG: ("mx", "my", "mz"), PRESSURE: ("pressure",)}
_AXES |= {TRUTH: ("truth_x", "truth_y")}
OPTIONAL: Mapping[str, tuple[str, ...]] = {TRUTH: ("truth_z", "truth_yaw")}
"""Fields beside those of `VECTORS`, which may lack."""
VECTORS: Mapping[str, tuple[str, ...]] = _AXES
QUANTITIES: Mapping[str, str] = {
    T: TIME,
    **{name: quantity for quantity, names in _AXES.items() for name in names},
    RANGE: RANGE,
    "std": RANGE,
    HEADING: HEADING,
    "heading_std": HEADING,
    "truth_z": TRUTH,
    "truth_yaw": HEADING,
}
FIELDS = (*QUANTITIES, T_NSEC, ANCHOR)
POSITION = ("id", "x", "y", "z")
_KEY = re.compile(r"(?:(?P<source>.+)/)?(?P<field>[^/]+)")


@dataclass(frozen=True)
class Column:
    """A column of a table. unit: as it was told, None if nobody told. sign: -1 turns an axis round."""

    name: str
    unit: str | None = None
    sign: int = 1

    def __str__(self) -> str:
        return f"{'-' if self.sign < 0 else ''}{self.name}{f':{self.unit}' if self.unit else ''}"


Fields = Mapping[str, Column]


def quantity_of(name: str) -> str | None:
    """Return the quantity of a field; None for those without a unit."""
    return RANGE if name.startswith(WIDE) else QUANTITIES.get(name)


@dataclass(frozen=True)
class ColumnMap:
    """The columns for all sources, and those for single ones, by the name of the source."""

    general: dict[str, str] = field(default_factory=dict)
    of_source: dict[str, dict[str, str]] = field(default_factory=dict)

    def texts_for(self, source: str) -> dict[str, str]:
        """Return the fields of a source, each with the text that names its column."""
        return self.general | self.of_source.get(source, {})

    def __bool__(self) -> bool:
        return bool(self.general or self.of_source)


def parsed(words: Iterable[str]) -> ColumnMap:
    """Return the mapping of the words of `--map`: [SOURCE/]FIELD=[-]COLUMN[:UNIT]. Raises ImportingError.

    Without a column the field is not read.
    """
    mapping = ColumnMap()
    for word in words:
        key, equals, column = word.partition("=")
        match = _KEY.fullmatch(key)
        if not equals or match is None:
            raise ImportingError(
                f"--map: {word!r} is not FIELD=COLUMN or FIELD=COLUMN:UNIT (a SOURCE stands before --map)"
            )
        _add(mapping, match["source"], match["field"], column, "--map")
    return mapping


def loaded(path: Path) -> ColumnMap:
    """Return the mapping of a file that `saved` wrote. Raises ImportingError, OSError."""
    try:
        content = tomllib.loads(path.read_text())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ImportingError(f"{path} is not TOML: {error}") from error
    mapping = ColumnMap()
    for section, columns in content.items():
        tables = {None: columns} if section == "map" else columns if section == "source" else None
        if not isinstance(tables, dict) or not all(isinstance(table, dict) for table in tables.values()):
            raise ImportingError(f'{path}: [{section}] is not known; there are [map] and [source."NAME"]')
        for source, table in tables.items():
            for name, column in table.items():
                if not isinstance(column, str):
                    raise ImportingError(f'{path}: {name} is not a text, as "COLUMN:UNIT"')
                _add(mapping, source, name, column, str(path))
    return mapping


def saved(fields: Mapping[str, Fields]) -> str:
    """Return the TOML of the fields of sources."""
    sections = []
    for source, columns in fields.items():
        lines = [f"{_quoted(name)} = {_quoted(str(column))}" for name, column in columns.items()]
        sections.append("\n".join([f"[source.{_quoted(source)}]", *lines]))
    return "\n\n".join(sections) + "\n"


def words_of(fields: Fields, source: str | None = None) -> list[str]:
    """Return the words of `--map` as a shell takes them. source: the only one they are for."""
    prefix = "" if source is None else f"{source}/"
    return [shlex.quote(f"{prefix}{name}={column}") for name, column in fields.items()]


def resolved(text: str, columns: Iterable[str], name: str) -> Column | None:
    """Return the column that a text of `--map` names, None if the table has no such column.

    A number names a column of a table without a header. Raises ImportingError for an unknown unit.
    """
    names = list(columns)
    quantity = quantity_of(name)
    for sign, rest in ((1, text), (-1, text[1:] if text.startswith("-") else "")):
        if rest in names:
            return Column(rest, None, sign)
        column, colon, unit = rest.rpartition(":")
        if colon and column in names:
            if quantity is None:
                raise ImportingError(f"--map {name}={text}: {name} has no unit")
            return Column(column, _known(unit, quantity, name, text), sign)
    return None


def column_text(text: str) -> str:
    """Return the column that a text of `--map` names, without its unit."""
    return text.rpartition(":")[0] or text


def _known(unit: str, quantity: str, name: str, text: str) -> str:
    try:
        conversion(unit, quantity)
    except ImportingError as error:
        raise ImportingError(f"--map {name}={text}: {error}") from None
    return unit


def _add(mapping: ColumnMap, source: str | None, name: str, column: str, where: str) -> None:
    if name not in FIELDS and not (name.startswith(WIDE) and len(name) > len(WIDE)) and name not in POSITION:
        raise ImportingError(
            f"{where}: {name!r} is not a field{did_you_mean(name, FIELDS)}; the fields are {', '.join(FIELDS)}, and "
            f"{WIDE}ID for a column with the ranges to the anchor ID"
        )
    target = mapping.general if source is None else mapping.of_source.setdefault(source, {})
    target[name] = column


def _quoted(text: str) -> str:
    escaped = "".join(c if c >= " " and c not in '"\\' and c != "\x7f" else f"\\u{ord(c):04x}" for c in text)
    return f'"{escaped}"'
