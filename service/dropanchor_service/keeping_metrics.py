"""What is kept on disk, for Prometheus."""

from collections.abc import Iterable

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from dropanchor_service.store.tracks import Tracks


class HistoryMetrics(Collector):
    """Read from the history when they are asked for."""

    def __init__(self, tracks: Tracks) -> None:
        self._tracks = tracks

    def collect(self) -> Iterable[Metric]:
        tracks, writer = self._tracks, self._tracks.writer
        yield CounterMetricFamily("dropanchor_history_poses", "Poses written to the history.", tracks.written)
        yield CounterMetricFamily(
            "dropanchor_history_dropped", "Poses that could not be written and were dropped.", writer.dropped
        )
        yield CounterMetricFamily("dropanchor_history_errors", "Attempts to write that failed.", writer.errors)
        yield GaugeMetricFamily(
            "dropanchor_history_failing", "1 while the history cannot be written.", writer.problem is not None
        )
        yield GaugeMetricFamily("dropanchor_history_bytes", "Bytes that the history uses.", tracks.used_bytes)
