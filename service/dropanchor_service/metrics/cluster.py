"""Gauges of a process in a cluster: whether it owns its bucket, with which epoch, and how old its lease is."""

from collections.abc import Callable, Iterable

from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

OwnerState = Callable[[], tuple[int, float] | None]
"""Returns the epoch of the owner, and the age of its lease in s; None in a standby."""


class ClusterGauges(Collector):
    """Gauges that are read at every scrape."""

    def __init__(self, bucket: str, state: OwnerState) -> None:
        self._bucket = bucket
        self._state = state

    def collect(self) -> Iterable[Metric]:
        state = self._state()
        yield self._gauge("owner", "1 in the process that serves the bucket, 0 in a standby.", state is not None)
        if state is not None:
            yield self._gauge("epoch", "Epoch of the owner: it grows with each takeover.", state[0])
            yield self._gauge("lease_age_seconds", "Time since the database renewed the owner's lease.", state[1])

    def _gauge(self, name: str, meaning: str, value: float) -> Metric:
        gauge = GaugeMetricFamily(f"dropanchor_cluster_{name}", meaning, labels=["bucket"])
        gauge.add_metric([self._bucket], value)
        return gauge
