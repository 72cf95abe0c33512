"""Record incoming messages and outgoing poses in a series of files."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import BinaryIO

import numpy as np

from dropanchor_schemas.file_names import file_name_of
from dropanchor_service.estimation.columns import Array
from dropanchor_service.recording import folder as files
from dropanchor_service.recording.folder import Limits, RecordedFile
from dropanchor_service.recording.mcap_file import SESSION, McapFile
from dropanchor_service.recording.output import End, Item, Messages, Output, Poses, Samples, SiteChange
from dropanchor_service.runtime.background_writer import BackgroundWriter
from dropanchor_service.store.decimation import Decimation
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import TagTable
from dropanchor_tag_client.folder_lock import FolderLock

FOLDER = "recordings"
WRITE_S = 1.0  # so much of a recording a kill can lose
MAX_QUEUED_BYTES = 64 * 2**20
MESSAGE_OVERHEAD = 150  # bytes of a queued message beside its payload


@dataclass(frozen=True)
class RunningRecording:
    """A recording in progress. tags: the recorded tags, None for all."""

    since_ns: int
    tags: tuple[str, ...] | None


class Recorder:
    """Records while it is started. A background thread writes the files.

    The ingest thread calls `record_messages` and `record_poses`; any thread calls `start` and `stop`.
    All messages of one turn of the ingest carry its time as `log_time` and their arrival as `publish_time`, so that a
    replay can repeat the turns.
    """

    def __init__(
        self,
        data_dir: Path,
        limits: Limits,
        pose_period_ns: int,
        tags: TagTable,
        site: SiteStore,
        now_ns: Callable[[], int],
        metadata: Mapping[str, str],
    ) -> None:
        """Create a recorder that does not record yet. metadata: what a replay needs, stored in every file."""
        self.folder = data_dir / FOLDER
        self._limits = limits
        self._pose_period_ns = pose_period_ns
        self._tags = tags
        self._site = site
        self._now_ns = now_ns
        self._metadata = metadata
        self._running: RunningRecording | None = None
        self.on_change: list[Callable[[], None]] = []  # called after a begin or an end, on its thread
        self._ending = threading.Lock()  # nothing is queued behind the end, where it would open another file
        self._site_version = 0
        self._session = ""
        self._preparing = Lock()
        self._owned: FolderLock | None = None
        self._decimation = Decimation(pose_period_ns)
        self._output = Output(self._new_file, self._prune, limits, tags, site)
        self.writer: BackgroundWriter[Item] = BackgroundWriter(
            "recording", self._output.write, WRITE_S, MAX_QUEUED_BYTES
        )

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        if self.writer.is_alive:
            self.writer.stop()
        if self._owned is not None:
            self._owned.close()

    def _tell(self) -> None:
        for told in self.on_change:
            told()

    @property
    def running(self) -> RunningRecording | None:
        """The recording in progress, or None."""
        return self._running

    @property
    def written(self) -> int:
        """The number of messages written so far."""
        return self._output.written

    @property
    def open_name(self) -> str | None:
        """The name of the file that is being written, or None."""
        return self._output.open_name

    @property
    def ended_name(self) -> str | None:
        """The name of the last file of the recording that was stopped last; None if it has none."""
        return self._output.ended_name

    def files(self) -> list[RecordedFile]:
        """Return the recorded files, the oldest first."""
        return files.files_in(self.folder)

    def opened(self, name: str) -> BinaryIO | None:
        """Open the file of this name; None if there is none. Raises OSError."""
        return files.opened(self.folder, name)

    def prepare(self) -> None:
        """Create and lock the folder now rather than with the first file. Raises OSError."""
        with self._preparing:
            self.folder.mkdir(parents=True, exist_ok=True)
            if self._owned is None:
                self._owned = FolderLock(self.folder)

    def start(self, tags: Sequence[str] | None = None) -> bool:
        """Start recording these tags; without any, all. Return False when a recording is already running."""
        if self._running is not None:
            return False
        if not self.writer.is_alive:  # most of many sites never record
            self.writer.start()
        self._site_version = 0
        self._decimation = Decimation(self._pose_period_ns)
        since_ns = self._now_ns()
        self._session = str(since_ns)
        self._running = RunningRecording(since_ns, tuple(tags) if tags else None)
        self._tell()
        return True

    def stop(self, wait_s: float = 0.0) -> bool:
        """Stop recording. Return False when nothing is being recorded.

        wait_s: how long to wait until the last file is finished. A disk that takes nothing delays that.
        """
        end = End()
        with self._ending:
            if self._running is None:
                return False
            self._running = None
            self.writer.put(end, 0)
        self._tell()
        if wait_s > 0:
            self.writer.wake()
            end.is_done.wait(wait_s)
        return True

    def record_messages(self, messages: Messages) -> None:
        """Queue the messages of one turn of the ingest, if a recording is running."""
        running = self._running
        if running is None:
            return
        now_ns = self._now_ns()
        if running.tags is not None:
            rows = self._rows(running.tags)
            messages = [message for message in messages if message[0] in rows]
        size = sum(len(message[1]) for message in messages) + MESSAGE_OVERHEAD * len(messages)
        with self._ending:
            if self._running is running:
                self._queue_site_change(now_ns)
                if messages:
                    self.writer.put(Samples(now_ns, messages), size, len(messages))

    def record_poses(self, poses: Array) -> None:
        """Queue decimated poses, if a recording is running. poses: POSE, in order of time per row."""
        running = self._running
        if running is None:
            return
        kept = self._decimation.select(poses)
        if running.tags is not None:
            kept = kept[np.isin(kept["row"], list(self._rows(running.tags)))]
        with self._ending:
            if len(kept) and self._running is running:
                self.writer.put(Poses(self._now_ns(), kept), kept.nbytes, len(kept))

    def _new_file(self, t_ns: int) -> McapFile:
        self.prepare()
        name = files.new_name(file_name_of(self._site.site.id), t_ns)
        return McapFile(self.folder / name, {**self._metadata, SESSION: self._session})

    def _prune(self, open_name: str | None) -> None:
        if self._owned is not None:
            files.prune(self.folder, self._limits, open_name)

    def _queue_site_change(self, now_ns: int) -> None:
        version = self._site.version
        if version != self._site_version:
            self._site_version = version
            self.writer.put(SiteChange(now_ns, self._site.document), 0)

    def _rows(self, names: Sequence[str]) -> set[int]:
        return {tag.row for tag in map(self._tags.find, names) if tag is not None}
