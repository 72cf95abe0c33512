"""Keep the tracks of a site in a SQLite file: pruned by age and size, and moved aside when it is damaged."""

import logging
import sqlite3
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.sqlite.damaged_file import damaged_files, is_damage, move_aside
from dropanchor_service.history.sqlite.track_file import FileReader, TrackWriter
from dropanchor_service.history.storage import Retention, Usage

FILE_NAME = "history.sqlite"
MAX_PRUNE_S = 0.5  # per write
MAX_SUMMARISE_S = 0.2  # per write
MAX_DAMAGED_FILES = 3  # that are moved aside: a disk that keeps damaging files must not fill up with them

_log = logging.getLogger(__name__)


class SqliteStorage:
    """The `Storage` in a file of a folder. `write` raises sqlite3.Error and OSError."""

    def __init__(self, folder: Path, retention: Retention, now_ns: Callable[[], int]) -> None:
        self._path = folder / FILE_NAME
        self._retention = retention
        self._now_ns = now_ns
        self._file: TrackWriter | None = None
        self.reader = FileReader(self._path)
        self.usage = Usage()
        self.damaged: list[str] = []

    def close(self) -> None:
        if self._file is not None:
            self._file.close()

    def write(self, poses: Array, tags: Sequence[str], anchors: Sequence[str | None]) -> None:
        try:
            self._write(poses, tags, anchors)
        except sqlite3.DatabaseError as error:
            if not is_damage(error) or len(damaged_files(self._path)) >= MAX_DAMAGED_FILES:
                raise
            self._move_damaged_file_aside(error)
            self._write(poses, tags, anchors)

    def _write(self, poses: Array, tags: Sequence[str], anchors: Sequence[str | None]) -> None:
        if self._file is None:
            self._file = TrackWriter(self._path)
        try:
            if len(poses):
                self._file.insert(poses, tags, anchors)
            self._prune(self._file)
            _summarise(self._file)
        except sqlite3.Error:
            self._file.close()  # the next attempt opens the file again, which may be repaired by then
            self._file = None
            raise

    def _move_damaged_file_aside(self, error: sqlite3.Error) -> None:
        when = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(self._now_ns() * 1e-9))
        name = move_aside(self._path, when)
        self.damaged.append(name)
        _log.error("%s is damaged (%s): it was renamed to %s and a new history was started", self._path, error, name)

    def _prune(self, file: TrackWriter) -> None:
        end_s = time.monotonic() + MAX_PRUNE_S
        keep_from_ns = self._now_ns() - self._retention.keep_ns
        while file.prune(keep_from_ns, self._retention.max_bytes) and time.monotonic() < end_s:
            pass
        self.usage.bytes = file.used_bytes()


def _summarise(file: TrackWriter) -> None:
    end_s = time.monotonic() + MAX_SUMMARISE_S
    while file.summarise() and time.monotonic() < end_s:
        pass
