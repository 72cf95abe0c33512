"""Store the tracks of all tags on disk: decimated, written in the background, pruned by age and size."""

import logging
import sqlite3
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array
from dropanchor_service.history.damaged_file import damaged_files, is_damage, move_aside
from dropanchor_service.history.heat_map import HeatMap
from dropanchor_service.history.overview import Overview
from dropanchor_service.history.records import StoredPoses
from dropanchor_service.history.track_file import TrackReader, TrackWriter
from dropanchor_service.runtime.background_writer import BackgroundWriter
from dropanchor_service.store.decimation import Decimation
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import TagTable

FILE_NAME = "history.sqlite"
WRITE_S = 2.0
MAX_PRUNE_S = 0.5  # per write
MAX_SUMMARISE_S = 0.2  # per write
MAX_QUEUED_BYTES = 64 * 2**20
MAX_DAMAGED_FILES = 3  # that are moved aside: a disk that keeps damaging files must not fill up with them

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Retention:
    """Which poses are kept, and for how long. HistorySettings explains each limit."""

    period_ns: int
    distance_m: float
    still_ns: int
    keep_ns: int
    max_bytes: int


class Tracks:
    """The stored tracks. The ingest thread calls `offer`, any thread calls `poses`.

    A background thread writes while this context manager is open.
    """

    def __init__(
        self, folder: Path, retention: Retention, tags: TagTable, site: SiteStore, now_ns: Callable[[], int]
    ) -> None:
        self._path = folder / FILE_NAME
        self._retention = retention
        self._tags = tags
        self._site = site
        self._now_ns = now_ns
        self._decimation = Decimation(retention.period_ns, retention.distance_m, retention.still_ns)
        self._file: TrackWriter | None = None
        self._reader = TrackReader(self._path)
        self.writer: BackgroundWriter[Array] = BackgroundWriter("history", self._write, WRITE_S, MAX_QUEUED_BYTES)
        self.written = 0
        self.used_bytes = 0
        self.damaged: list[str] = []  # names of files that were moved aside

    def __enter__(self) -> "Tracks":
        self.writer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.stop()
        if self._file is not None and not self.writer.is_alive:
            self._file.close()

    def offer(self, poses: Array) -> None:
        """Queue the poses worth keeping. poses: POSE, in order of time per row. Never blocks."""
        kept = self._decimation.select(poses)
        if len(kept):
            self.writer.put(kept, kept.nbytes, len(kept))

    def poses(self, tag: str, from_ns: int, to_ns: int, limit: int, newest_first: bool = False) -> StoredPoses:
        """Return up to `limit` poses of the tag between the two times. Raises sqlite3.Error."""
        return self._reader.poses(tag, from_ns, to_ns, limit, newest_first)

    def overview(self, tags: Sequence[str] | None, from_ns: int, to_ns: int, max_points: int) -> Overview:
        """Return the figures of these tags, or of all, and at most `max_points` points of each.

        Raises sqlite3.Error and TooMuchError.
        """
        return self._reader.overview(tags, from_ns, to_ns, max_points)

    def heat_map(self, tags: Sequence[str] | None, from_ns: int, to_ns: int, cell_m: float) -> HeatMap:
        """Return where these tags, or all, were, in squares of at least `cell_m`.

        Raises sqlite3.Error and TooMuchError.
        """
        return self._reader.heat_map(tags, from_ns, to_ns, cell_m)

    def tags(self) -> list[str]:
        """Return all tags of which poses were ever stored. Raises sqlite3.Error."""
        return self._reader.tags()

    def span(self) -> tuple[int, int] | None:
        """Return the time that the stored poses cover, ns; None without poses. Raises sqlite3.Error."""
        return self._reader.span()

    def has_tag(self, tag: str) -> bool:
        """Return whether poses of this tag were ever stored. Raises sqlite3.Error."""
        return self._reader.has_tag(tag)

    @property
    def problems(self) -> Sequence[str]:
        """Problems for the operator: the history cannot be written, or a file was damaged."""
        damaged = [
            f"the history was damaged and a new one was started; the old file is {name}" for name in self.damaged
        ]
        return damaged if self.writer.problem is None else [self.writer.problem, *damaged]

    def _write(self, batches: Sequence[Array]) -> None:
        try:
            self._insert_and_prune(batches)
        except sqlite3.DatabaseError as error:
            if not is_damage(error) or len(damaged_files(self._path)) >= MAX_DAMAGED_FILES:
                raise
            self._move_damaged_file_aside(error)
            self._insert_and_prune(batches)

    def _insert_and_prune(self, batches: Sequence[Array]) -> None:
        if self._file is None:
            self._file = TrackWriter(self._path)
        try:
            self._insert(self._file, np.concatenate([np.empty(0, POSE), *batches]))
            self._prune(self._file)
            self._summarise(self._file)
        except sqlite3.Error:
            self._file.close()  # the next attempt opens the file again, which may be repaired by then
            self._file = None
            raise

    def _move_damaged_file_aside(self, error: sqlite3.Error) -> None:
        when = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(self._now_ns() * 1e-9))
        name = move_aside(self._path, when)
        self.damaged.append(name)
        _log.error("%s is damaged (%s): it was renamed to %s and a new history was started", self._path, error, name)

    def _insert(self, file: TrackWriter, poses: Array) -> None:
        if len(poses):
            anchors = [anchor.id for anchor in self._site.anchors_by_index()]
            names = [self._tags.at(row).name for row in poses["row"].tolist()]
            used = [anchors[index] if 0 <= index < len(anchors) else None for index in poses["anchor"].tolist()]
            file.insert(poses, names, used)
            self.written += len(poses)

    def _prune(self, file: TrackWriter) -> None:
        end_s = time.monotonic() + MAX_PRUNE_S
        keep_from_ns = self._now_ns() - self._retention.keep_ns
        while file.prune(keep_from_ns, self._retention.max_bytes) and time.monotonic() < end_s:
            pass
        self.used_bytes = file.used_bytes()

    def _summarise(self, file: TrackWriter) -> None:
        end_s = time.monotonic() + MAX_SUMMARISE_S
        while file.summarise() and time.monotonic() < end_s:
            pass
