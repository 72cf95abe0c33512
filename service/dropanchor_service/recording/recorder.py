"""Records what comes in and what comes out, while it is asked to, in files that follow each other."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dropanchor_schemas.keys import chunk_from_id
from dropanchor_service.estimation.columns import Array
from dropanchor_service.recording import folder as files
from dropanchor_service.recording.folder import Limits, RecordedFile
from dropanchor_service.recording.mcap_file import SESSION, McapFile
from dropanchor_service.recording.output import End, Item, Messages, Output, Poses, Samples, SiteChange
from dropanchor_service.runtime.background_writer import BackgroundWriter
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import TagTable
from dropanchor_service.store.thinning import Decimation

FOLDER = "recordings"
WRITE_S = 1.0  # what a kill can cost
MOST_WAITING_BYTES = 64 * 2**20
MESSAGE_BYTES = 150  # that a waiting message takes beside its payload


@dataclass(frozen=True)
class Running:
    """tags: those that are recorded, None for all."""

    since_ns: int
    tags: tuple[str, ...] | None


class Recorder:
    """`messages` and `poses` are called by the ingest thread, `start` and `stop` by any; a thread of its own writes.

    All messages of one turn of the ingest carry its time as `log_time`, and the time of their arrival as
    `publish_time`: so a replay can repeat the turns.
    """

    def __init__(
        self,
        data_dir: Path,
        limits: Limits,
        pose_period_ns: int,
        tags: TagTable,
        site: SiteStore,
        now_ns: Callable[[], int],
        about: Mapping[str, str],
    ) -> None:
        """about: what a replay has to know, kept in every file."""
        self.folder = data_dir / FOLDER
        self._limits = limits
        self._pose_period_ns = pose_period_ns
        self._tags = tags
        self._site = site
        self._now_ns = now_ns
        self._about = about
        self._running: Running | None = None
        self._site_version = 0
        self._session = ""
        self._thinning = Decimation(pose_period_ns)
        self._output = Output(self._new_file, self._prune, limits, tags, site)
        self.writer: BackgroundWriter[Item] = BackgroundWriter(
            "recording", self._output.write, WRITE_S, MOST_WAITING_BYTES
        )

    def __enter__(self) -> "Recorder":
        self.writer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self.writer.stop()

    @property
    def running(self) -> Running | None:
        return self._running

    @property
    def written(self) -> int:
        """Messages so far."""
        return self._output.written

    @property
    def open_name(self) -> str | None:
        return self._output.open_name

    def files(self) -> list[RecordedFile]:
        """The oldest first."""
        return files.files_in(self.folder)

    def path_of(self, name: str) -> Path | None:
        return files.path_of(self.folder, name)

    def prepare(self) -> None:
        """Make the folder, which otherwise is made with the first file. Raises OSError."""
        self.folder.mkdir(parents=True, exist_ok=True)

    def start(self, tags: Sequence[str] | None = None) -> bool:
        """False when it records already."""
        if self._running is not None:
            return False
        self._site_version = 0
        self._thinning = Decimation(self._pose_period_ns)
        since_ns = self._now_ns()
        self._session = str(since_ns)
        self._running = Running(since_ns, None if tags is None else tuple(tags))
        return True

    def stop(self) -> bool:
        """False when it does not record. The file is finished a moment later."""
        if self._running is None:
            return False
        self._running = None
        self.writer.put(End(), 0)
        return True

    def messages(self, messages: Messages) -> None:
        """Of one turn of the ingest."""
        running = self._running
        if running is None:
            return
        now_ns = self._now_ns()
        self._follow_site(now_ns)
        if running.tags is not None:
            rows = self._rows(running.tags)
            messages = [message for message in messages if message[0] in rows]
        if messages:
            size = sum(len(message[1]) for message in messages) + MESSAGE_BYTES * len(messages)
            self.writer.put(Samples(now_ns, messages), size, len(messages))

    def poses(self, poses: Array) -> None:
        """POSE, per row in order of time."""
        running = self._running
        if running is None:
            return
        kept = self._thinning.of(poses)
        if running.tags is not None:
            kept = kept[np.isin(kept["row"], list(self._rows(running.tags)))]
        if len(kept):
            self.writer.put(Poses(self._now_ns(), kept), kept.nbytes, len(kept))

    def _new_file(self, t_ns: int) -> McapFile:
        self.folder.mkdir(parents=True, exist_ok=True)
        name = files.new_name(chunk_from_id(self._site.site.id), t_ns)
        return McapFile(self.folder / name, {**self._about, SESSION: self._session})

    def _prune(self, open_name: str | None) -> None:
        files.prune(self.folder, self._limits, open_name)

    def _follow_site(self, now_ns: int) -> None:
        version = self._site.version
        if version != self._site_version:
            self._site_version = version
            self.writer.put(SiteChange(now_ns, self._site.document), 0)

    def _rows(self, names: Sequence[str]) -> set[int]:
        return {tag.row for tag in map(self._tags.find, names) if tag is not None}
