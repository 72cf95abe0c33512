"""Unpack files without filling the memory: a small file may hold gigabytes of one byte."""

import gzip
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

from dropanchor_tag_client.recording.recording import RecordingError

PLAUSIBLE_RATIO, ALWAYS_BYTES = 50, 2**22  # text of readings packs to a third or a tenth
MAX_LINE = 2**20


class Source(Protocol):
    def read(self, size: int, /) -> bytes: ...


def require_plausible(name: object, packed: int, unpacked: int) -> None:
    """Raise RecordingError for a file that unpacks to more than readings do. packed, unpacked: bytes."""
    if unpacked > max(ALWAYS_BYTES, PLAUSIBLE_RATIO * packed):
        raise RecordingError(
            f"{name} unpacks to more than {PLAUSIBLE_RATIO} times its {packed:,} bytes, which readings never do, and "
            f"to more than {ALWAYS_BYTES // 2**20} MiB. If the file is to be trusted, unpack it first"
        )


class Bounded(io.RawIOBase):
    """What is read from `source`, until it is more than is plausible."""

    def __init__(self, source: Source, name: object, packed: int) -> None:
        self._source, self._name, self._packed, self._count = source, name, packed, 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: bytearray | memoryview, /) -> int:  # type: ignore[override]
        data = self._source.read(len(buffer))
        buffer[: len(data)] = data
        self._count += len(data)
        require_plausible(self._name, self._packed, self._count)
        return len(data)


def unpacked(path: Path) -> io.BufferedReader:
    """Open a file, unpacked if its name ends in .gz. Raises OSError; reading raises RecordingError, EOFError."""
    if path.suffix != ".gz":
        return path.open("rb")
    return io.BufferedReader(Bounded(gzip.open(path), path, path.stat().st_size), 2**16)


def lines_of(text: io.TextIOBase, name: object) -> Iterator[str]:
    """Yield the lines of a text. Raises RecordingError for one that is too long to be of a table."""
    for number, line in enumerate(iter(lambda: text.readline(MAX_LINE), ""), 1):
        if len(line) == MAX_LINE:
            raise RecordingError(f"{name} line {number} is longer than {MAX_LINE:,} characters: this is no table")
        yield line
