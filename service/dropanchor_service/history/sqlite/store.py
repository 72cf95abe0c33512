"""Keep the tracks of a site in a SQLite file: pruned by age and size, and set aside when it is damaged."""

import sqlite3
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from dropanchor_schemas.sentences import say
from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.sqlite.damaged_file import damage_in, is_damage
from dropanchor_service.history.sqlite.track_file import FileReader, TrackWriter
from dropanchor_service.history.storage import Retention, Usage
from dropanchor_service.runtime.recovery import Recovery, damaged

FILE_NAME = "history.sqlite"
MAX_PRUNE_S = 0.5  # per write
MAX_SUMMARISE_S = 0.2  # per write
CHECK_S = 1.0  # at a start: a large file is checked in part
FULL_CHECK_S = 60.0  # once a reader has found damage
INSTEAD = say("new_history", "a new history was started")


class SqliteStorage:
    """The `Storage` in a file of a folder. `write` raises sqlite3.Error and OSError."""

    waits_for = "the disk"

    def __init__(
        self, folder: Path, retention: Retention, now_ns: Callable[[], int], recovery: Recovery | None = None
    ) -> None:
        """Check the file that is there. recovery: reports it if it is damaged."""
        self._path = folder / FILE_NAME
        self._retention = retention
        self._now_ns = now_ns
        self._file: TrackWriter | None = None
        self.reader = FileReader(self._path)
        self.usage = Usage()
        self.damaged: list[str] = []
        self._recovery = recovery or Recovery()
        self._check(CHECK_S)

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None

    def write(self, poses: Array, tags: Sequence[str], anchors: Sequence[str | None]) -> None:
        if self.reader.has_found_damage:
            self.reader.has_found_damage = False
            self.close()
            self._check(FULL_CHECK_S)
        try:
            self._write(poses, tags, anchors)
        except sqlite3.DatabaseError as error:
            if not is_damage(error) or not self._set_aside(damaged(error)):
                raise
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
            self.close()  # the next attempt opens the file again, which may be repaired by then
            raise

    def _check(self, most_s: float) -> None:
        why = damage_in(self._path, most_s)
        if why is not None:
            self._set_aside(why)

    def _set_aside(self, why: str) -> bool:
        """Return whether the damaged file is out of the way."""
        aside = self._recovery.set_aside(self._path, why, INSTEAD)
        if aside is not None:
            self.damaged.append(aside.name)
        return aside is not None

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
