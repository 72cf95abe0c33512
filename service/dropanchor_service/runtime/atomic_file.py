"""Write files that are complete or absent even after a power failure."""

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

UP_TO_UMASK = 0o666


def write_atomically(path: Path, parts: Iterable[bytes | memoryview], mode: int = UP_TO_UMASK) -> None:
    """Replace the file, so that readers find the old or the new content, never a mixture.

    mode: the permissions, less the umask; the file never has wider ones. Raises OSError, and then the old file is
    unchanged.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.part")
    try:
        part.unlink(missing_ok=True)  # a killed writer may have left one with other permissions
        _write(part, parts, mode)
        os.replace(part, path)
    except OSError:
        with suppress(OSError):
            os.unlink(part)
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Write the names in the folder to the disk, so that new files survive a power failure. Raises OSError."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _write(path: Path, parts: Iterable[bytes | memoryview], mode: int) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
    try:
        for part in parts:
            remaining = memoryview(part)
            while remaining:
                remaining = remaining[os.write(descriptor, remaining) :]
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
