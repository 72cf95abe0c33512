"""One owner for each folder that a process writes: a lock that the kernel releases, and who holds it."""

import errno
import json
import logging
import os
import socket
import sys
import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, Self

if sys.platform != "win32":
    import fcntl

FILE = "owner.lock"
_MOST_BYTES = 1024
_POLL_S = 0.05
_NO_LINK: int = getattr(os, "O_NOFOLLOW", 0)
_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)  # of the file system, see flock(2)

_log = logging.getLogger(__name__)


class Owner(NamedTuple):
    """Who holds a lock. since: UTC, as in RFC 3339."""

    pid: int
    host: str
    since: str

    def __str__(self) -> str:
        return f"process {self.pid} on {self.host} since {self.since}"


class FolderInUseError(OSError):
    """Another process has the folder; the message says which."""

    def __init__(self, folder: Path, owner: Owner | None) -> None:
        super().__init__(f"{folder} is in use by {owner or 'another process'}")
        self.strerror = str(self.args[0])


class NoLocksError(OSError):
    """The file system has no locks."""


class LockIsLinkError(OSError):
    """The file of the lock is a link, whose target would be overwritten."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path} is a link, and would overwrite what it leads to: remove it")
        self.strerror = str(self.args[0])


class FolderLock:
    """Holds a folder until it is closed, or until this process ends in any way.

    Creating it raises FolderInUseError while another process holds the folder, and OSError where there is none.
    excludes_others: False where the file system has no locks, or nobody can write there.
    """

    def __init__(self, folder: Path, file: str = FILE, shared: bool = False, wait_s: float = 0.0) -> None:
        """Lock a file in the folder, and write into it who has it.

        shared: others may share the folder, but nobody may have it alone. wait_s: how long to wait for the holder.
        """
        self._close: Callable[[], object] = _nothing
        self.excludes_others = False
        descriptor = _opened(folder / file)
        if descriptor is None:
            return
        self._close = weakref.finalize(self, os.close, descriptor)
        try:
            if not _locked(descriptor, shared, time.monotonic() + wait_s):
                owner = _owner(descriptor)
                self._close()
                raise FolderInUseError(folder, owner)
            self.excludes_others = sys.platform != "win32"
        except NoLocksError as error:
            _log.warning(
                "the file system of %s has no locks (%s): take care that only one process uses it",
                folder,
                error.strerror,
            )
        _sign(descriptor)

    def close(self) -> None:
        self._close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @staticmethod
    def holder(folder: Path, file: str = FILE) -> Owner | None:
        """Return who holds the folder, None if nobody does, or if nobody knows."""
        with suppress(OSError):
            descriptor = os.open(folder / file, os.O_RDONLY | _NO_LINK)
            try:
                return None if _locked(descriptor, shared=True, end_s=0.0) else _owner(descriptor)
            finally:
                os.close(descriptor)
        return None


def _nothing() -> None:
    return


def _opened(path: Path) -> int | None:
    """Open the file; where it cannot be written, for reading. None: it cannot be made, so nobody can write there."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | _NO_LINK | getattr(os, "O_CLOEXEC", 0), 0o600)
    except FileNotFoundError:
        raise
    except OSError as error:
        if path.is_symlink():
            raise LockIsLinkError(path) from error
        with suppress(OSError):
            return os.open(path, os.O_RDONLY | _NO_LINK)
        if isinstance(error, NotADirectoryError | IsADirectoryError):
            raise
        _log.warning("%s cannot be made (%s), so nothing keeps a second process out", path, error.strerror)
        return None


def _locked(descriptor: int, shared: bool, end_s: float) -> bool:
    """Lock an open file. Return False while others hold it at the end. Raises NoLocksError."""
    if sys.platform == "win32":
        return True
    while True:
        try:
            fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= end_s:
                return False
            time.sleep(_POLL_S)
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
            raise NoLocksError(error.errno, error.strerror) from error
        else:
            return True


def _sign(descriptor: int) -> None:
    """Write who has the lock. On a full or read-only disk the lock holds without it."""
    who = Owner(os.getpid(), socket.gethostname(), time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()))
    with suppress(OSError):
        os.ftruncate(descriptor, 0)
        os.lseek(descriptor, 0, os.SEEK_SET)
        os.write(descriptor, json.dumps(who._asdict()).encode() + b"\n")


def _owner(descriptor: int) -> Owner | None:
    with suppress(OSError, ValueError, TypeError):
        os.lseek(descriptor, 0, os.SEEK_SET)
        found = json.loads(os.read(descriptor, _MOST_BYTES))
        return Owner(int(found["pid"]), str(found["host"]), str(found["since"]))
    return None
