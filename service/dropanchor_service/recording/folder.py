"""The folder of the recordings: list its files and delete the oldest."""

import os
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

from mcap.writer import MCAP0_MAGIC

from dropanchor_service.runtime.open_below import open_below

SUFFIX = ".mcap"
_NAME = re.compile(r"[A-Za-z0-9._%-]{1,250}\.mcap")


@dataclass(frozen=True)
class Limits:
    """When a file is full and which files are kept. All limits apply together."""

    file_bytes: int
    file_ns: int
    keep_files: int
    keep_ns: int
    max_bytes: int


@dataclass(frozen=True)
class RecordedFile:
    """A file in the folder. `finished` says whether it has its index.

    A file has no index while it is written, or when the service was killed meanwhile.
    """

    name: str
    size: int
    changed_ns: int
    finished: bool


def new_name(prefix: str, t_ns: int) -> str:
    """Return a file name for a recording that starts at `t_ns`. Names sort by time."""
    return f"{prefix}-{datetime.fromtimestamp(t_ns // 10**9, UTC):%Y%m%dT%H%M%S}-{t_ns % 10**9 // 10**3:06d}Z{SUFFIX}"


def opened(folder: Path, name: str) -> BinaryIO | None:
    """Open the recording of this name; None if there is none. No name and no link leads out of the folder."""
    if not _NAME.fullmatch(name):
        return None
    try:
        return open_below(folder, name)
    except FileNotFoundError:
        return None


def files_in(folder: Path) -> list[RecordedFile]:
    """Return the recordings in the folder, the oldest first."""
    found = [file for path in folder.glob(f"*{SUFFIX}") if (file := _file(path)) is not None]
    return sorted(found, key=lambda file: (file.changed_ns, file.name))


def prune(folder: Path, limits: Limits, open_name: str | None) -> None:
    """Delete the oldest files until the limits hold, but never the open one. Raises OSError."""
    for name in _excess_files(files_in(folder), limits, open_name):
        (folder / name).unlink(missing_ok=True)


def _excess_files(files: list[RecordedFile], limits: Limits, open_name: str | None) -> Iterator[str]:
    total, oldest_ns = sum(file.size for file in files), time.time_ns() - limits.keep_ns
    for index, file in enumerate(files):
        too_many = len(files) - index > limits.keep_files
        if file.name != open_name and (too_many or total > limits.max_bytes or file.changed_ns < oldest_ns):
            total -= file.size
            yield file.name


def _file(path: Path) -> RecordedFile | None:
    try:
        with open_below(path.parent, path.name) as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(-min(size, len(MCAP0_MAGIC)), os.SEEK_END)
            finished = size > 2 * len(MCAP0_MAGIC) and file.read() == MCAP0_MAGIC
            return RecordedFile(path.name, size, os.fstat(file.fileno()).st_mtime_ns, finished)
    except FileNotFoundError:  # deleted meanwhile, or a link
        return None
