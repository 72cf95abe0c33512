"""What numba's cache of compiled kernels does here instead: it trusts no file, and needs no room.

numba imports this module when the first kernel is defined, because NUMBA_CACHE_LOCATOR_CLASSES names `Place`.
"""

import io
import logging
import os
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from numba.core import caching

from dropanchor_service.runtime.kernel_files import DIRECTORY_MODE, NOT_OF_OTHERS, digest, read_whole

_log = logging.getLogger(__name__)


class Place(caching.UserProvidedCacheLocator):
    """The folder that NUMBA_CACHE_DIR names and no other, whether it can be written or not."""

    def ensure_cache_path(self) -> None:
        """Leave it to `CheckedFiles.save`, where a failure does no harm."""


class CheckedFiles(caching.IndexDataCacheFile):
    """The files of one kernel. What cannot be used is compiled anew; what cannot be saved stays in memory."""

    def save(self, key: Any, data: Any) -> None:
        try:
            os.makedirs(self._cache_path, DIRECTORY_MODE, exist_ok=True)
            super().save(key, data)  # type: ignore[no-untyped-call]
        except OSError as error:
            _say_not_kept(error.strerror)

    def _load_index(self) -> dict[Any, str]:
        if (content := read_whole(Path(self._index_path))) is None:
            return {}
        file = io.BytesIO(content)
        if pickle.load(file) != self._version:
            return {}
        stamp, overloads = pickle.load(file)
        return overloads if stamp == self._source_stamp else {}

    def _load_data(self, name: str) -> Any:
        """Return what was saved. Raises FileNotFoundError, and then numba compiles."""
        if (content := read_whole(Path(self._cache_path, name))) is None:
            raise FileNotFoundError
        return pickle.loads(content)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[io.BytesIO]:
        with super()._open_for_write(filepath) as file:
            content = io.BytesIO()
            yield content
            os.fchmod(file.fileno(), os.fstat(file.fileno()).st_mode & NOT_OF_OTHERS)
            file.write(content.getvalue() + digest(content.getvalue()))


@cache
def _say_not_kept(why: str) -> None:
    _log.warning("the compiled kernels cannot be kept (%s): they are in memory until this process ends", why)


# numba has a setting for the place of the files, and none for how it reads them.
caching.IndexDataCacheFile = CheckedFiles  # type: ignore[misc]
