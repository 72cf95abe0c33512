"""Metrics of the history and the recording."""

from collections.abc import Iterable
from typing import Any

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from dropanchor_service.history.tracks import Tracks
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.runtime.background_writer import BackgroundWriter


class HistoryMetrics(Collector):
    """Metrics that are read from the history at every scrape."""

    def __init__(self, tracks: Tracks) -> None:
        self._tracks = tracks

    def collect(self) -> Iterable[Metric]:
        tracks = self._tracks
        yield CounterMetricFamily("dropanchor_history_poses", "Poses written to the history.", tracks.written)
        yield GaugeMetricFamily("dropanchor_history_bytes", "Bytes that the history uses.", tracks.used_bytes)
        yield CounterMetricFamily(
            "dropanchor_history_damaged", "Damaged history files that were moved aside.", len(tracks.damaged)
        )
        yield from _writer_metrics("history", tracks.writer)


class RecordingMetrics(Collector):
    """Metrics that are read from the recorder at every scrape."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder

    def collect(self) -> Iterable[Metric]:
        recorder = self._recorder
        yield CounterMetricFamily("dropanchor_recording_messages", "Messages and poses recorded.", recorder.written)
        yield GaugeMetricFamily(
            "dropanchor_recording_running", "1 while a recording is running.", recorder.running is not None
        )
        yield from _writer_metrics("recording", recorder.writer)


def _writer_metrics(name: str, writer: BackgroundWriter[Any]) -> Iterable[Metric]:
    yield CounterMetricFamily(
        f"dropanchor_{name}_dropped",
        f"Items that the {name} dropped because its queue was full or a write failed for good.",
        writer.dropped,
    )
    yield CounterMetricFamily(f"dropanchor_{name}_errors", f"Failed attempts to write the {name}.", writer.errors)
    yield GaugeMetricFamily(
        f"dropanchor_{name}_failing", f"1 while the {name} cannot be written.", writer.problem is not None
    )
