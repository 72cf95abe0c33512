"""What is kept on disk, for Prometheus."""

from collections.abc import Iterable
from typing import Any

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from dropanchor_service.history.tracks import Tracks
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.runtime.background_writer import BackgroundWriter


class HistoryMetrics(Collector):
    """Read from the history when they are asked for."""

    def __init__(self, tracks: Tracks) -> None:
        self._tracks = tracks

    def collect(self) -> Iterable[Metric]:
        tracks = self._tracks
        yield CounterMetricFamily("dropanchor_history_poses", "Poses written to the history.", tracks.written)
        yield GaugeMetricFamily("dropanchor_history_bytes", "Bytes that the history uses.", tracks.used_bytes)
        yield CounterMetricFamily(
            "dropanchor_history_damaged", "Damaged files of the history that were set aside.", len(tracks.damaged)
        )
        yield from _of_writer("history", tracks.writer)


class RecordingMetrics(Collector):
    """Read from the recorder when they are asked for."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder

    def collect(self) -> Iterable[Metric]:
        recorder = self._recorder
        yield CounterMetricFamily("dropanchor_recording_messages", "Messages and poses recorded.", recorder.written)
        yield GaugeMetricFamily(
            "dropanchor_recording_running", "1 while samples are recorded.", recorder.running is not None
        )
        yield from _of_writer("recording", recorder.writer)


def _of_writer(name: str, writer: BackgroundWriter[Any]) -> Iterable[Metric]:
    yield CounterMetricFamily(f"dropanchor_{name}_dropped", f"What the {name} could not take and lost.", writer.dropped)
    yield CounterMetricFamily(f"dropanchor_{name}_errors", f"Attempts to write the {name} that failed.", writer.errors)
    yield GaugeMetricFamily(
        f"dropanchor_{name}_failing", f"1 while the {name} cannot be written.", writer.problem is not None
    )
