"""One node for each folder: the lock that its process holds, and who holds it."""

import fcntl
import os
from contextlib import suppress
from pathlib import Path
from typing import IO, Self

FILE = "node.lock"


class NodeLock:
    """Holds the lock while it is open. Entering it raises ValueError while another process holds it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __enter__(self) -> Self:
        self._folder.mkdir(parents=True, exist_ok=True)
        self._file: IO[str] = (self._folder / FILE).open("a+")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._file.close()
            raise ValueError(f"a node runs already with the folder {self._folder}: stop it, or use another") from error
        self._file.truncate(0)
        self._file.write(f"{os.getpid()}\n")
        self._file.flush()
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    @staticmethod
    def holder(folder: Path) -> int | None:
        """Return the process that holds the lock, None if nobody does."""
        with suppress(OSError, ValueError), (folder / FILE).open() as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return int(file.read())
        return None
