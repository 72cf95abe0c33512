"""Keep the files of this process from other users of the machine: they hold keys, secrets of receivers and places."""

import logging
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from dropanchor_service.runtime.data_files import OF_SERVICE

_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_OF_DISKS = ("lost+found",)

_log = logging.getLogger(__name__)


def keep_private(folder: Path | None) -> None:
    """Let only the user of this process read what it writes from now on, and what the data folder holds of a service.

    folder: may be missing. One that holds files of others stays as it is, but not what is in it of a service. One that
    another user owns stays as it is, with a warning.
    """
    os.umask(_OTHERS)
    if folder is None or not folder.is_dir():
        return
    try:
        if folder.stat().st_mode & _OTHERS:
            for path in _of_service(folder):  # the folder last: an interrupted start does all of it again
                path.chmod(stat.S_IMODE(path.stat().st_mode) & ~_OTHERS)
    except OSError as error:
        _log.warning(
            "other users may read %s (%s): make the user of the service its owner, or run chmod -R go= %s",
            folder,
            error.strerror,
            folder,
        )


def _of_service(folder: Path) -> Iterator[Path]:
    """Yield what a service has written there, and at last the folder if it holds nothing else."""
    written = {path for pattern in OF_SERVICE for path in folder.glob(pattern) if not path.is_symlink()}
    for path in written:
        yield from _within(path)
    if all(path in written or path.is_symlink() or path.name in _OF_DISKS for path in folder.iterdir()):
        yield folder


def _within(path: Path) -> Iterator[Path]:
    """Yield a path and all files and folders below it, but no links: what they point at may be somebody else's."""
    for root, folders, files in os.walk(path):
        yield from (below for name in (*folders, *files) if not (below := Path(root, name)).is_symlink())
    yield path
