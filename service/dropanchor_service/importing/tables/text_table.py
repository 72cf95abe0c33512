"""Tables of text, however they are written: separators, decimal commas, quotes, encodings, comments, headers."""

import csv
import io
import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE, getincrementaldecoder
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar

from dropanchor_service.importing.files import File
from dropanchor_service.importing.progress import shown
from dropanchor_service.importing.readings import ImportingError, LeftOut
from dropanchor_service.importing.tables.table import RANGE_ADVICE, Row, number
from dropanchor_service.importing.tables.times import iso_ns
from dropanchor_tag_client.recording.bounded import lines_of

_HEAD_BYTES = 65_536
_HEAD_LINES = 60
_NAMES = {";": "semicolons", "\t": "tabs", "|": "bars", ",": "commas", " ": "spaces"}
_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d*,\d+(?:[eE][-+]?\d+)?\s*")
_COMMENTS = ("#", "%", "//")


@dataclass(frozen=True)
class TextTable:
    """name: of the file. separator: of the columns; a space stands for any white space. first: its first line with
    values, counted from 1."""

    unit: ClassVar[str] = "line"
    name: str
    columns: tuple[str, ...]
    notes: tuple[str, ...]
    file: File
    encoding: str
    separator: str
    first: int
    anchor_advice: str = RANGE_ADVICE

    def rows(self, left_out: LeftOut) -> Iterator[Row]:
        """Yield the rows that have a value for each column. Raises ImportingError."""
        width = len(self.columns)
        with self.file.opened() as raw:
            lines = io.TextIOWrapper(raw, self.encoding, errors="replace", newline="")
            for line, cells in _split(shown(lines_of(lines, self.name), self.name), self.separator, self.name):
                if line < self.first or not cells:
                    continue
                while len(cells) > width and not cells[-1]:
                    cells.pop()
                if len(cells) == width:
                    yield line, cells
                else:
                    left_out.add(self.name, f"the number of values is not {width}", line)


def read_table(file: File) -> TextTable:
    """Return the table of a file. Raises ImportingError where there is none in it."""
    with file.opened() as raw:
        head = raw.read(_HEAD_BYTES)
    encoding, notes = _encoding(head)
    text = getincrementaldecoder(encoding)(errors="replace").decode(head)
    lines = text.splitlines(keepends=True)[: _HEAD_LINES + 1]
    lines = lines[:-1] if len(lines) > 1 and len(head) == _HEAD_BYTES else lines[:_HEAD_LINES]
    if not any(map(str.strip, lines)):
        raise ImportingError(f"{file.name} is empty")
    separator = _separator(lines, file.name)
    rows = [(line, cells) for line, cells in _split(lines, separator, file.name) if cells]
    width = Counter(len(cells) for _, cells in rows).most_common(1)[0][0]
    first, header = next((line, cells) for line, cells in rows if len(cells) == width)
    if first > 1 and any(line < first for line, _ in rows):
        notes.append(f"the lines before line {first} are no part of the table: they are left out")
    notes += [f"columns are separated by {_NAMES[separator]}"] if separator != "," else []
    if any(_DECIMAL_COMMA.fullmatch(cell) for _, cells in rows for cell in cells):
        notes.append("numbers have decimal commas")
    if _is_header(header):
        columns, first = header, first + 1
    elif (above := _commented_header(lines[: first - 1], separator, width)) is not None:
        columns = above
    else:
        columns = [str(index + 1) for index in range(width)]
        notes.append(f"there is no header: the columns are numbered 1 to {width}")
    while columns and not columns[-1].strip():
        columns = columns[:-1]
    return TextTable(file.name, _distinct(columns), tuple(notes), file, encoding, separator, first)


def _encoding(head: bytes) -> tuple[str, list[str]]:
    """Return the encoding of a text, and a note if it is not UTF-8."""
    if head.startswith(BOM_UTF8):
        return "utf-8-sig", []
    if head.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return "utf-16", ["the text is UTF-16"]
    if b"\0" in head[:200]:
        return ("utf-16-le" if head[1:2] == b"\0" else "utf-16-be"), ["the text is UTF-16"]
    try:
        getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "cp1252", ["the text is not UTF-8: read as Windows-1252"]
    return "utf-8", []


def _separator(lines: list[str], name: str) -> str:
    """Return the separator that splits most lines into the same number of columns; a comma may be a decimal one."""
    best = {}
    for separator in _NAMES:
        widths = Counter(len(cells) for _, cells in _split(lines, separator, name) if cells)
        width, count = max(((w, c) for w, c in widths.items() if w > 1), key=lambda item: item[1], default=(1, 0))
        best[separator] = count, width
    most = max(count for count, _ in best.values())
    if not most:
        raise ImportingError(f"{name} is no table: its lines have no columns")
    return next(separator for separator, (count, _) in best.items() if 10 * count >= 9 * most)


def _split(lines: Iterable[str], separator: str, name: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the cells of each line; none for a comment or an empty line."""
    content = ("\n" if line.lstrip().startswith(_COMMENTS) else line for line in lines)
    if separator == " ":
        yield from ((number, line.split()) for number, line in enumerate(content, 1))
        return
    reader = csv.reader(content, delimiter=separator, skipinitialspace=True)
    try:
        for cells in reader:
            yield reader.line_num, cells if any(map(str.strip, cells)) else []
    except csv.Error as error:
        raise ImportingError(f"{name} line {reader.line_num} cannot be read: {error}") from error


def _is_header(cells: list[str]) -> bool:
    """Return whether most cells are names."""
    filled = [cell for cell in cells if cell.strip()]
    return 2 * sum(map(_is_name, filled)) > len(filled)


def _is_name(cell: str) -> bool:
    try:
        number(cell)
    except ValueError:
        return iso_ns(cell) is None
    return False


def _commented_header(lines: list[str], separator: str, width: int) -> list[str] | None:
    """Return the names in the last comment before the values, as numpy and EuRoC write them."""
    for line in reversed(lines):
        plain = line.strip().lstrip("#%/").strip()
        if line.lstrip().startswith(_COMMENTS) and plain:
            cells = next(iter(_split([plain], separator, "")), (0, []))[1]
            return cells if len(cells) == width and _is_header(cells) else None
    return None


def _distinct(names: list[str]) -> tuple[str, ...]:
    """Return the names without white space around them; a second one of the same name gets a number."""
    counts: Counter[str] = Counter()
    distinct = []
    for plain in (name.strip().lstrip("%").strip() for name in names):
        counts[plain] += 1
        distinct.append(plain if counts[plain] == 1 else f"{plain}.{counts[plain]}")
    return tuple(distinct)
