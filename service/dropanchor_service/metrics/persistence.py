"""Metrics of the history and the recording."""

from collections.abc import Iterable, Sequence
from typing import Any

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from dropanchor_service.history.tracks import Tracks
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.runtime.background_writer import BackgroundWriter


class HistoryMetrics(Collector):
    """Metrics that are read from the histories of all sites at every scrape."""

    def __init__(self, *tracks: Tracks) -> None:
        self._tracks = tracks

    def collect(self) -> Iterable[Metric]:
        tracks = self._tracks
        written, usages = sum(one.written for one in tracks), {id(one.usage): one.usage for one in tracks}
        used = sum(usage.bytes for usage in usages.values())
        yield CounterMetricFamily("dropanchor_history_poses", "Poses written to the history.", written)
        yield GaugeMetricFamily("dropanchor_history_bytes", "Bytes that the history uses.", used)
        yield CounterMetricFamily(
            "dropanchor_history_damaged",
            "Damaged history files that were moved aside.",
            sum(len(one.damaged) for one in tracks),
        )
        yield from _writer_metrics("history", [one.writer for one in tracks])


class RecordingMetrics(Collector):
    """Metrics that are read from the recorders of all sites at every scrape."""

    def __init__(self, *recorders: Recorder) -> None:
        self._recorders = recorders

    def collect(self) -> Iterable[Metric]:
        recorders = self._recorders
        written = sum(one.written for one in recorders)
        running = any(one.running is not None for one in recorders)
        yield CounterMetricFamily("dropanchor_recording_messages", "Messages and poses recorded.", written)
        yield GaugeMetricFamily("dropanchor_recording_running", "1 while a recording is running.", running)
        yield from _writer_metrics("recording", [one.writer for one in recorders])


def _writer_metrics(name: str, writers: Sequence[BackgroundWriter[Any]]) -> Iterable[Metric]:
    yield CounterMetricFamily(
        f"dropanchor_{name}_dropped",
        f"Items that the {name} dropped because its queue was full or a write failed for good.",
        sum(writer.dropped for writer in writers),
    )
    errors = sum(writer.errors for writer in writers)
    yield CounterMetricFamily(f"dropanchor_{name}_errors", f"Failed attempts to write the {name}.", errors)
    yield GaugeMetricFamily(
        f"dropanchor_{name}_failing",
        f"1 while the {name} cannot be written.",
        any(writer.problem is not None for writer in writers),
    )
