"""What is kept on disk for long: the history of poses and the recordings, as far as the settings want them."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Self

from dropanchor_service.estimation.columns import Array
from dropanchor_service.history.tracks import Retention, Tracks
from dropanchor_service.ingest.observers import NO_OBSERVERS, Observers
from dropanchor_service.metrics.persistence import HistoryMetrics, RecordingMetrics
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.recording.folder import Limits
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.settings.model import HistorySettings, RecordingSettings, Settings
from dropanchor_service.store import SiteStore, TagTable


class Persistence:
    """They write while this is open. tracks, recorder: None where there is none."""

    def __init__(
        self, settings: Settings, tags: TagTable, site: SiteStore, now_ns: Callable[[], int], metrics: Metrics
    ) -> None:
        self._settings = settings
        self._opened = ExitStack()
        self.tracks: Tracks | None = None
        self.recorder: Recorder | None = None
        folder = settings.data_dir
        if folder is None:
            return
        if settings.history.enabled:
            self.tracks = Tracks(folder, retention_of(settings.history), tags, site, now_ns)
            metrics.watch(HistoryMetrics(self.tracks))
        about = {
            "engine": settings.engine,
            "paper": settings.paper.model_dump_json(),
            "ingest": settings.ingest.model_dump_json(),
        }
        period_ns = round(settings.recording.pose_period_s * 1e9)
        self.recorder = Recorder(folder, file_limits_of(settings.recording), period_ns, tags, site, now_ns, about)
        metrics.watch(RecordingMetrics(self.recorder))

    def __enter__(self) -> Self:
        for part in (self.tracks, self.recorder):
            if part is not None:
                self._opened.enter_context(part)
        if self.recorder is not None and self._settings.recording.enabled:
            self.recorder.start(self._settings.recording.tags or None)
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    @property
    def observers(self) -> Observers:
        tracks, recorder = self.tracks, self.recorder

        def take(poses: Array) -> None:
            if tracks is not None:
                tracks.offer(poses)
            if recorder is not None:
                recorder.poses(poses)

        return NO_OBSERVERS if recorder is None else Observers(recorder.messages, take)

    def problems(self) -> Sequence[str]:
        """Why one of them does not write, or has lost what it had."""
        of_tracks = [] if self.tracks is None else self.tracks.problems
        recorder = None if self.recorder is None else self.recorder.writer.problem
        return [*of_tracks, *([] if recorder is None else [recorder])]


def retention_of(settings: HistorySettings) -> Retention:
    """Return what the history keeps, in its own units."""
    return Retention(
        period_ns=round(settings.period_s * 1e9),
        distance_m=settings.distance_m,
        still_ns=round(settings.still_s * 1e9),
        keep_ns=round(settings.keep_days * 86_400e9),
        max_bytes=int(settings.most_mib * 2**20),
    )


def file_limits_of(settings: RecordingSettings) -> Limits:
    """Return when a recording's file is full and which files are kept, in the recorder's units."""
    return Limits(
        file_bytes=int(settings.file_mib * 2**20),
        file_ns=round(settings.file_minutes * 60e9),
        keep_files=settings.keep_files,
        keep_ns=round(settings.keep_days * 86_400e9),
        max_bytes=int(settings.most_mib * 2**20),
    )
