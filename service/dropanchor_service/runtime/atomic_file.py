"""Files that are whole or not there, whenever the power goes."""

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

_UP_TO_UMASK = 0o666


def write_atomically(path: Path, parts: Iterable[bytes | memoryview], mode: int = _UP_TO_UMASK) -> None:
    """Write the file so that it is the old one or the new one, never half of one.

    mode: its permissions, less the umask; it never had wider ones. Raises OSError, and then the old file is untouched.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.part")
    try:
        part.unlink(missing_ok=True)  # a killed writer may have left it, with other permissions
        _write(part, parts, mode)
        os.replace(part, path)
    except OSError:
        with suppress(OSError):
            os.unlink(part)
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Put the folder's names on the disk: the content of a file is of no use without its name. Raises OSError."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _write(path: Path, parts: Iterable[bytes | memoryview], mode: int) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
    try:
        for part in parts:
            left = memoryview(part)
            while left:
                left = left[os.write(descriptor, left) :]
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
