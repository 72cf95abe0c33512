"""Permissions of credential files, and a lock that lets only one process change them at a time."""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PRIVATE, PUBLIC = 0o600, 0o644


@contextmanager
def exclusive_lock(folder: Path) -> Iterator[None]:
    """Hold the lock of this folder; wait while another process has it."""
    with (folder / ".lock").open("ab") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
