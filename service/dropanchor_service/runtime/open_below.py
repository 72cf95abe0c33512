"""Open files that others may have put into a folder of the service: nothing but regular files that lie in it."""

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

_FLAGS = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK  # a pipe without a writer must not block
_LINK = (errno.ELOOP, errno.EMLINK)  # EMLINK: FreeBSD


def open_below(folder: Path, name: str) -> BinaryIO:
    """Open the file with this name in this folder to read it.

    A link, a pipe, a folder, or a name that leads elsewhere counts as missing. Raises OSError.
    """
    if name != Path(name).name:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), name)
    try:
        descriptor = os.open(folder / name, _FLAGS)
    except OSError as error:
        if error.errno in _LINK:
            raise FileNotFoundError(errno.ENOENT, "it is a link", name) from error
        raise
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise FileNotFoundError(errno.ENOENT, "it is no file", name)
    return os.fdopen(descriptor, "rb")
