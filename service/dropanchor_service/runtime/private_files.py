"""Keep the files of this process from other users of the machine: they hold keys, secrets of receivers and places."""

import logging
import os
import stat
from collections.abc import Iterator
from pathlib import Path

_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_FOLDER = 0o700

_log = logging.getLogger(__name__)


def keep_private(folder: Path | None) -> None:
    """Let only the user of this process read what it writes from now on, and what the data folder holds already.

    folder: may be missing. One that another user owns stays as it is, with a warning.
    """
    os.umask(_OTHERS)
    if folder is None or not folder.is_dir() or not folder.stat().st_mode & _OTHERS:
        return
    try:
        for path in [*_below(folder), folder]:  # the folder last: an interrupted start does all of it again
            path.chmod(_FOLDER if path.is_dir() else stat.S_IMODE(path.stat().st_mode) & ~_OTHERS)
    except OSError as error:
        _log.warning(
            "other users may read %s (%s): make the user of the service its owner, or run chmod -R go= %s",
            folder,
            error.strerror,
            folder,
        )


def _below(folder: Path) -> Iterator[Path]:
    """Yield all files and folders below, but no links: what they point at may be somebody else's."""
    for root, folders, files in os.walk(folder):
        yield from (path for name in (*folders, *files) if not (path := Path(root, name)).is_symlink())
