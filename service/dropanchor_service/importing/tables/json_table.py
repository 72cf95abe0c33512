"""Tables of JSON: one object a line, or a list of objects. Nested fields get paths, as `imu.acc.x`."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import orjson

from dropanchor_service.importing.files import File
from dropanchor_service.importing.progress import shown
from dropanchor_service.importing.readings import ImportingError, LeftOut
from dropanchor_service.importing.tables.flat import flat_rows
from dropanchor_service.importing.tables.table import RANGE_ADVICE, Row

_SAMPLE = 2_000
_MAX_LIST_BYTES = 2**30


@dataclass(frozen=True)
class JsonTable:
    """columns: the paths in the first objects. is_list: whether the file is one list, not one object a line."""

    unit: ClassVar[str] = "line"
    name: str
    columns: tuple[str, ...]
    file: File
    is_list: bool
    notes: tuple[str, ...] = ()
    anchor_advice: str = RANGE_ADVICE

    def rows(self, left_out: LeftOut) -> Iterator[Row]:
        """Yield the rows of each object. Raises ImportingError."""
        for line, value in shown(_objects(self.file, self.is_list), self.name):
            if not isinstance(value, dict):
                left_out.add(self.name, "not a JSON object", line)
                continue
            for row in flat_rows(value):
                yield line, [row.get(column) for column in self.columns]


def read_json(file: File) -> JsonTable:
    """Return the table of a file of JSON. Raises ImportingError."""
    with file.opened() as raw:
        head = raw.read(4096).removeprefix(b"\xef\xbb\xbf").lstrip()
    is_list = head.startswith(b"[") or (head.startswith(b"{") and not _is_one_a_line(file))
    columns: dict[str, None] = {}
    for index, (_, value) in enumerate(_objects(file, is_list)):
        if index >= _SAMPLE:
            break
        if isinstance(value, dict):
            columns |= dict.fromkeys(name for row in flat_rows(value) for name in row)
    if not columns:
        raise ImportingError(f"{file.name} holds no JSON objects, one a line or in a list")
    return JsonTable(file.name, tuple(columns), file, is_list)


def _is_one_a_line(file: File) -> bool:
    """Return whether the first of several lines is an object."""
    with file.opened() as raw:
        lines = (line for line in raw if line.strip())
        return _parsed(next(lines, b"")) is not None and next(lines, None) is not None


def _objects(file: File, is_list: bool) -> Iterator[tuple[int, Any]]:
    """Yield the number of the line or place, and the object; None for what is no JSON."""
    if not is_list:
        with file.opened() as raw:
            for number, line in enumerate(raw, 1):
                if line.strip():
                    yield number, _parsed(line)
        return
    with file.opened() as raw:
        text = raw.read(_MAX_LIST_BYTES)
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ImportingError(f"{file.name} is not JSON: {error}") from error
    yield from enumerate(value if isinstance(value, list) else _rows_in(value), 1)


def _rows_in(value: Any) -> list[Any]:
    """Return the first list of objects in an object, or else the object."""
    inner = value.values() if isinstance(value, dict) else ()
    return next((v for v in inner if isinstance(v, list) and v and isinstance(v[0], dict)), [value])


def _parsed(line: bytes) -> Any:
    try:
        return orjson.loads(line.removeprefix(b"\xef\xbb\xbf"))
    except orjson.JSONDecodeError:
        return None
