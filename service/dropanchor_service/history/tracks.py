"""The tracks of all tags, kept on disk: thinned, written in the background, pruned by age and size."""

import logging
import sqlite3
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array
from dropanchor_service.history.damaged_file import is_damage, move_aside, set_aside
from dropanchor_service.history.track_file import Stored, TrackReader, TrackWriter
from dropanchor_service.runtime.background_writer import BackgroundWriter
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import TagTable
from dropanchor_service.store.thinning import Decimation

FILE_NAME = "history.sqlite"
WRITE_S = 2.0
PRUNE_S = 0.5  # at most so long at a time
MOST_WAITING_BYTES = 64 * 2**20
MOST_DAMAGED = 3  # files that are set aside; a disk that damages more of them is not filled with them

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Retention:
    """Which poses are kept, and for how long; the settings say what each limit means."""

    period_ns: int
    distance_m: float
    still_ns: int
    keep_ns: int
    most_bytes: int


class Tracks:
    """`offer` is called by the ingest thread, `poses` by any; a thread of its own writes while it is open."""

    def __init__(
        self, folder: Path, retention: Retention, tags: TagTable, site: SiteStore, now_ns: Callable[[], int]
    ) -> None:
        self._path = folder / FILE_NAME
        self._retention = retention
        self._tags = tags
        self._site = site
        self._now_ns = now_ns
        self._thinning = Decimation(retention.period_ns, retention.distance_m, retention.still_ns)
        self._file: TrackWriter | None = None
        self._reader = TrackReader(self._path)
        self.writer: BackgroundWriter[Array] = BackgroundWriter("history", self._write, WRITE_S, MOST_WAITING_BYTES)
        self.written = 0
        self.used_bytes = 0
        self.damaged: list[str] = []  # names of files that were set aside

    def __enter__(self) -> "Tracks":
        self.writer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.stop()
        if self._file is not None and not self.writer.is_alive:
            self._file.close()

    def offer(self, poses: Array) -> None:
        """POSE, per row in order of time."""
        kept = self._thinning.of(poses)
        if len(kept):
            self.writer.put(kept, kept.nbytes, len(kept))

    def poses(self, tag: str, from_ns: int, to_ns: int, most: int, newest_first: bool = False) -> Stored:
        """Raises sqlite3.Error."""
        return self._reader.poses(tag, from_ns, to_ns, most, newest_first)

    def knows(self, tag: str) -> bool:
        """Whether poses of this tag were ever kept. Raises sqlite3.Error."""
        return self._reader.knows(tag)

    @property
    def problems(self) -> Sequence[str]:
        """What an operator should know: that nothing can be written, that there was a damaged file."""
        told = [f"the history was damaged and begun afresh; what there was is kept as {name}" for name in self.damaged]
        return told if self.writer.problem is None else [self.writer.problem, *told]

    def _write(self, batches: Sequence[Array]) -> None:
        try:
            self._put(batches)
        except sqlite3.DatabaseError as error:
            if not is_damage(error) or len(set_aside(self._path)) >= MOST_DAMAGED:
                raise
            self._set_aside(error)
            self._put(batches)

    def _put(self, batches: Sequence[Array]) -> None:
        if self._file is None:
            self._file = TrackWriter(self._path)
        try:
            self._insert(self._file, np.concatenate([np.empty(0, POSE), *batches]))
            self._prune(self._file)
        except sqlite3.Error:
            self._file.close()  # opened afresh for the next attempt: what was wrong may have been repaired
            self._file = None
            raise

    def _set_aside(self, error: sqlite3.Error) -> None:
        when = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(self._now_ns() * 1e-9))
        name = move_aside(self._path, when)
        self.damaged.append(name)
        _log.error("%s is damaged (%s): it is kept as %s, and a new history is begun", self._path, error, name)

    def _insert(self, file: TrackWriter, poses: Array) -> None:
        if len(poses):
            anchors = [anchor.id for anchor in self._site.anchors_by_index()]
            names = [self._tags.at(row).name for row in poses["row"].tolist()]
            used = [anchors[index] if 0 <= index < len(anchors) else None for index in poses["anchor"].tolist()]
            file.insert(poses, names, used)
            self.written += len(poses)

    def _prune(self, file: TrackWriter) -> None:
        end_s = time.monotonic() + PRUNE_S
        keep_from_ns = self._now_ns() - self._retention.keep_ns
        while file.prune(keep_from_ns, self._retention.most_bytes) and time.monotonic() < end_s:
            pass
        self.used_bytes = file.used_bytes()
