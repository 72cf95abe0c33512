"""What is kept on disk for long: the history of poses and the recordings, as far as the settings want them."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Self

from dropanchor_service.estimation.batch import Array
from dropanchor_service.keeping_metrics import HistoryMetrics, RecordingMetrics
from dropanchor_service.metrics import Metrics
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.settings import Settings
from dropanchor_service.store import SiteStore, TagTable
from dropanchor_service.store.tracks import Tracks
from dropanchor_service.taps import NO_TAPS, Taps


class Keepers:
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
            self.tracks = Tracks(folder, settings.history.keeping(), tags, site, now_ns)
            metrics.watch(HistoryMetrics(self.tracks))
        about = {
            "engine": settings.engine,
            "paper": settings.paper.model_dump_json(),
            "ingest": settings.ingest.model_dump_json(),
        }
        period_ns = round(settings.recording.pose_period_s * 1e9)
        self.recorder = Recorder(folder, settings.recording.limits(), period_ns, tags, site, now_ns, about)
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
    def taps(self) -> Taps:
        tracks, recorder = self.tracks, self.recorder

        def take(poses: Array) -> None:
            if tracks is not None:
                tracks.offer(poses)
            if recorder is not None:
                recorder.poses(poses)

        return NO_TAPS if recorder is None else Taps(recorder.messages, take)

    def problems(self) -> Sequence[str]:
        """Why one of them does not write, or has lost what it had."""
        of_tracks = [] if self.tracks is None else self.tracks.problems
        recorder = None if self.recorder is None else self.recorder.writer.problem
        return [*of_tracks, *([] if recorder is None else [recorder])]
