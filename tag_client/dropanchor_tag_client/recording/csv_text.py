"""Read the text of CSV files, and say why a table is none of ours."""

import codecs
import gzip
import re
import shlex
import zlib
from collections.abc import Iterable
from pathlib import Path

from dropanchor_tag_client.recording.recording import RecordingError

_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_SEPARATORS = {";": "semicolons (;)", "\t": "tabs", "|": "bars (|)"}
_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d+,\d+([eE][-+]?\d+)?\s*")


def text_of(path: Path) -> str:
    """Return the text of a plain or gzipped file in UTF-8, or in UTF-16 with a byte order mark."""
    try:
        raw = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
    except (OSError, EOFError, zlib.error) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error
    encoding = "utf-16" if raw.startswith(_UTF_16) else "utf-8-sig"
    try:
        text = raw.decode(encoding)
        end = text.find("\0")
    except UnicodeDecodeError as error:
        text, end = raw[: error.start].decode(encoding, "replace"), error.start
    if end >= 0:
        line = text[:end].count("\n") + 1
        raise RecordingError(f"{path} line {line} cannot be read: this is not text in UTF-8")
    return text


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
