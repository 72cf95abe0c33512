"""Files with compiled code: each ends with a digest, and none is used that is damaged or that others can write.

A power cut, a bad copy or another user may have left anything there, and numba would run it.
"""

import hashlib
import os
import stat
from pathlib import Path

FORMAT = b"SHA-256 at the end"
DIRECTORY_MODE, NOT_OF_OTHERS = 0o755, ~0o022
_LENGTH = 32


def digest(content: bytes) -> bytes:
    return hashlib.sha256(content).digest()


def read_whole(path: Path) -> bytes | None:
    """Return what a file holds before its digest; None if it is damaged, cannot be read, or others can write it."""
    try:
        with path.open("rb") as file:
            if not _is_safe(os.fstat(file.fileno())):
                return None
            whole = file.read()
    except OSError:
        return None
    content = whole[:-_LENGTH]
    return content if whole[-_LENGTH:] == digest(content) else None


def damaged_in(folder: Path) -> list[Path]:
    """Return the files in a cache that would not be used."""
    return [file for file in sorted(folder.glob("*/*.nb[ic]")) if read_whole(file) is None]


def is_private(folder: Path) -> bool:
    """Return whether nobody but this user and the administrator can write into the folder. Raises OSError."""
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and _is_safe(found)


def _is_safe(found: os.stat_result) -> bool:
    return found.st_uid in (0, os.geteuid()) and not found.st_mode & ~NOT_OF_OTHERS
