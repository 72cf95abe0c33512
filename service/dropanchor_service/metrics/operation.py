"""Gauges of what an operator must look after: readiness, the disk, and certificates that end."""

import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path

from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

Expiries = Callable[[], Mapping[str, datetime]]
Problems = Callable[[], Sequence[str]]


class OperationGauges(Collector):
    """Gauges that are read at every scrape."""

    def __init__(self, problems: Problems, impairments: Problems, folder: Path | None, expiries: Expiries) -> None:
        """folder: where data is stored, None: nowhere. expiries: returns when each certificate ends, by its name."""
        self._problems = problems
        self._impairments = impairments
        self._folder = folder
        self._expiries = expiries

    def collect(self) -> Iterable[Metric]:
        yield GaugeMetricFamily("dropanchor_ready", "1 while the service can do its work.", not self._problems())
        yield GaugeMetricFamily(
            "dropanchor_impairments", "Things that do not work although the service does.", len(self._impairments())
        )
        ends = GaugeMetricFamily(
            "dropanchor_certificate_end_seconds",
            "When a certificate ends, Unix time; of the tags, the one that ends first.",
            labels=["certificate"],
        )
        for name, end in self._expiries().items():
            ends.add_metric([name], end.timestamp())
        yield ends
        yield from self._disk()

    def _disk(self) -> Iterable[Metric]:
        if self._folder is None:
            return
        try:
            usage = shutil.disk_usage(self._folder)
        except OSError:
            return
        yield GaugeMetricFamily("dropanchor_disk_bytes", "Size of the disk with the data folder.", usage.total)
        yield GaugeMetricFamily("dropanchor_disk_free_bytes", "What is free on it for the service.", usage.free)
