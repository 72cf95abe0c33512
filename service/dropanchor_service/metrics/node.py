"""The counters and gauges of an API node."""

from collections.abc import Callable, Iterable, Sequence

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

_SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)


class NodeMetrics:
    """All metrics of a node, in a registry of their own."""

    def __init__(self) -> None:
        self.registry = registry = CollectorRegistry()
        ProcessCollector(registry=registry)
        self.requests = Counter(
            "dropanchor_node_requests", "Requests for owners of buckets, by status.", ["status"], registry=registry
        )
        self.repeated = Counter(
            "dropanchor_node_repeated_requests",
            "Requests that were sent once more, because an owner did not answer.",
            registry=registry,
        )
        self.dropped = Counter(
            "dropanchor_node_dropped_answers", "Answers of former owners, which were dropped.", registry=registry
        )
        self.open = Gauge(
            "dropanchor_node_open_requests", "Requests, streams and WebSockets that are open.", registry=registry
        )
        self.seconds = Histogram(
            "dropanchor_node_answer_seconds",
            "Time until an owner begins its answer.",
            buckets=_SECONDS,
            registry=registry,
        )


class LeaseGauges(Collector):
    """What a node knows of the table of leases.

    buckets, without_owner: their names. age_s: returns when the table was read; None: never.
    """

    def __init__(
        self,
        buckets: Callable[[], Sequence[str]],
        without_owner: Callable[[], Sequence[str]],
        age_s: Callable[[], float | None],
    ) -> None:
        self._buckets = buckets
        self._without_owner = without_owner
        self._age_s = age_s

    def collect(self) -> Iterable[Metric]:
        yield GaugeMetricFamily("dropanchor_node_buckets", "Buckets in the table of leases.", len(self._buckets()))
        yield GaugeMetricFamily(
            "dropanchor_node_buckets_without_owner", "Buckets that nobody serves.", len(self._without_owner())
        )
        age_s = self._age_s()
        if age_s is not None:
            yield GaugeMetricFamily("dropanchor_node_leases_age_seconds", "Time since the table was read.", age_s)
