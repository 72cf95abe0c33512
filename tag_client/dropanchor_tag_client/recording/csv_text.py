"""Read the text of CSV files, and say why a table is none of ours."""

import codecs
import io
import re
import shlex
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from dropanchor_tag_client.recording.bounded import lines_of, unpacked
from dropanchor_tag_client.recording.recording import RecordingError

_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_NO_TEXT = ("\0", "\ufffd")
_SEPARATORS = {";": "semicolons (;)", "\t": "tabs", "|": "bars (|)"}
_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d+,\d+([eE][-+]?\d+)?\s*")


def lines_of_text(path: Path) -> Iterator[str]:
    """Yield the lines of a plain or gzipped file in UTF-8, or in UTF-16 with a byte order mark."""
    try:
        with unpacked(path) as file:
            encoding = "utf-16" if file.peek(2).startswith(_UTF_16) else "utf-8-sig"
            text = io.TextIOWrapper(file, encoding, errors="replace", newline="")
            for number, line in enumerate(lines_of(text, path), 1):
                if any(mark in line for mark in _NO_TEXT):
                    raise RecordingError(f"{path} line {number} cannot be read: this is not text in UTF-8")
                yield line
    except (OSError, EOFError, zlib.error) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error


def why_not_ours(header: str, needed: Iterable[str]) -> str | None:
    """Return what separates the columns of this header, None if commas do."""
    for separator, name in _SEPARATORS.items():
        if set(needed) <= {word.strip(' "') for word in header.split(separator)}:
            return f"the columns are separated by {name}, not by commas"
    return None


def has_decimal_comma(value: str) -> bool:
    return _DECIMAL_COMMA.fullmatch(value) is not None


def import_hint(source: Path) -> str:
    """Return the command that makes a recording of the source."""
    target = f"{source.resolve().name.partition('.')[0] or 'recording'}-imported"
    return f"Make a recording of it: dropanchor import {shlex.quote(str(source))} --out {shlex.quote(target)}"
