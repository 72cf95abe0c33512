"""The tracks of all tags of a site: decimated, and written in the background to where they are kept."""

from collections.abc import Sequence

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array
from dropanchor_service.history.reader import TrackReader
from dropanchor_service.history.storage import Retention, Storage, Usage
from dropanchor_service.runtime.background_writer import BackgroundWriter
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import TagTable

WRITE_S = 2.0
MAX_QUEUED_BYTES = 64 * 2**20


class Tracks:
    """The stored tracks. The ingest thread calls `offer`, any thread reads.

    A background thread writes while this context manager is open.
    """

    def __init__(self, storage: Storage, retention: Retention, tags: TagTable, site: SiteStore) -> None:
        self._storage = storage
        self._tags = tags
        self._site = site
        self._decimation = retention.decimation()
        self.writer: BackgroundWriter[Array] = BackgroundWriter(
            "history", self._write, WRITE_S, MAX_QUEUED_BYTES, storage.waits_for
        )
        self.written = 0

    def __enter__(self) -> "Tracks":
        self.writer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.stop()
        if not self.writer.is_alive:
            self._storage.close()

    def offer(self, poses: Array) -> None:
        """Queue the poses worth keeping. poses: POSE, in order of time per row. Never blocks."""
        self.keep(self._decimation.select(poses))

    def keep(self, kept: Array) -> None:
        """Queue POSE that are decimated already. Never blocks."""
        if len(kept):
            self.writer.put(kept, kept.nbytes, len(kept))

    @property
    def reader(self) -> TrackReader:
        """What reads the stored poses, in any thread. Raises HistoryError."""
        return self._storage.reader

    @property
    def usage(self) -> Usage:
        """The space that the history takes."""
        return self._storage.usage

    @property
    def damaged(self) -> Sequence[str]:
        """Names of damaged files that were set aside."""
        return self._storage.damaged

    @property
    def problems(self) -> Sequence[str]:
        """Return why the history cannot be written."""
        return [] if self.writer.problem is None else [self.writer.problem]

    def _write(self, batches: Sequence[Array]) -> None:
        poses = np.concatenate([np.empty(0, POSE), *batches])
        anchors = [anchor.id for anchor in self._site.anchors_by_index()]
        names = [self._tags.rows.at(row).name for row in poses["row"].tolist()]
        used = [anchors[index] if 0 <= index < len(anchors) else None for index in poses["anchor"].tolist()]
        self._storage.write(poses, names, used)
        self.written += len(poses)
