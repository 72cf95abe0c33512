"""A folder of objects that several machines share: a mounted one, or one of a store such as S3, through fsspec."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fsspec

from dropanchor_service.checkpoints.format import CheckpointError
from dropanchor_service.runtime.atomic_file import write_atomically

_LIMITS = {"connect_timeout": 2, "read_timeout": 10, "retries": {"max_attempts": 1}}
_OPTIONS: dict[str, dict[str, Any]] = {"s3": {"config_kwargs": _LIMITS, "use_listings_cache": False}}
"""The library of S3 would wait for minutes. Address and credentials are those of its own settings."""


class ObjectFolder:
    """Objects below one URL. Names are paths below it. Thread-safe. Creating it raises CheckpointError."""

    def __init__(self, url: str) -> None:
        self.url = url.rstrip("/")
        protocol = url.partition("://")[0]
        try:
            self._files, self._root = fsspec.url_to_fs(self.url, **_OPTIONS.get(protocol, {}))
        except (ImportError, ValueError) as error:
            raise CheckpointError(f"{self.url} cannot be used: {_sentence(error)}") from error
        self._is_local = protocol in ("file", "local")

    def write(self, name: str, parts: Sequence[bytes | memoryview]) -> None:
        """Write an object that is complete or absent. Raises CheckpointError."""
        try:
            if self._is_local:
                write_atomically(Path(self._path(name)), parts)
            else:
                self._files.pipe_file(self._path(name), b"".join(parts))
        except Exception as error:  # each store has its own
            raise CheckpointError(f"{self.url} does not take it: {_sentence(error)}") from error

    def read(self, name: str) -> bytes | None:
        """Return the content of an object, None if there is none. Raises CheckpointError if nobody answers."""
        try:
            return bytes(self._files.cat_file(self._path(name)))
        except FileNotFoundError:
            return None
        except Exception as error:
            raise CheckpointError(f"{self.url} does not answer: {_sentence(error)}") from error

    def names(self, folder: str) -> list[str]:
        """Return the objects in a folder, sorted. Raises CheckpointError."""
        try:
            found = self._files.ls(self._path(folder), detail=False)
        except FileNotFoundError:
            return []
        except Exception as error:
            raise CheckpointError(f"{self.url} does not answer: {_sentence(error)}") from error
        return sorted(f"{folder}/{str(path).rpartition('/')[2]}" for path in found if not str(path).endswith(".part"))

    def delete(self, name: str) -> None:
        """Delete an object. Raises CheckpointError."""
        try:
            self._files.rm_file(self._path(name))
        except FileNotFoundError:
            return
        except Exception as error:
            raise CheckpointError(f"{self.url} does not delete: {_sentence(error)}") from error

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}"


def _sentence(error: Exception) -> str:
    """Return an error in one line, without a full stop."""
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__
