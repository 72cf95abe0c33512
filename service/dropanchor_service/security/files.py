"""Permissions of credential files, and a lock that lets only one process change them at a time."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dropanchor_tag_client.folder_lock import FolderLock

PRIVATE, PUBLIC = 0o600, 0o644
LOCK = ".lock"
WAIT_S = 10.0  # a change takes milliseconds


@contextmanager
def exclusive_lock(folder: Path) -> Iterator[None]:
    """Hold the lock of this folder; wait while another process has it. Raises FolderInUseError and OSError."""
    with FolderLock(folder, LOCK, wait_s=WAIT_S):
        yield


def may_write(folder: Path) -> bool:
    """Return whether this process may create files in a folder, which may have to be made first."""
    found = next(path for path in (folder, *folder.absolute().parents) if os.path.exists(path))
    effective = os.access in os.supports_effective_ids
    return found.is_dir() and os.access(found, os.W_OK | os.X_OK, effective_ids=effective)
