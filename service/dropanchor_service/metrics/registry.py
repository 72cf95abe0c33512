"""The counters and gauges of the service for Prometheus."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Literal, get_args

import numpy as np
from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from dropanchor_schemas.wire import Reason
from dropanchor_service.answers.columns import aged_poses
from dropanchor_service.answers.frames import STATES, published_states
from dropanchor_service.store.latest_poses import LatestPoses
from dropanchor_service.store.rows import KINDS
from dropanchor_service.store.sites import Sites

FaultPlace = Literal["caches", "decoder", "estimator", "ingest", "observer", "publication", "query"]

_SECONDS = (0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5)


class Metrics:
    """All metrics, in a registry of their own, so that several services fit into one process."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        self._counter = partial(Counter, registry=self.registry)
        self._add_messages()
        self._add_missing_messages()
        self._add_estimators()
        self._add_checkpoints()

    def _add_messages(self) -> None:
        self.messages = self._counter("dropanchor_messages", "Messages received from tags.")
        self.samples = self._counter("dropanchor_samples", "Samples passed to the estimators.", ["kind"])
        self.rejected = self._counter("dropanchor_rejected", "Messages and samples that were rejected.", ["reason"])
        self.shed_samples = self._counter(
            "dropanchor_shed_samples", "Samples of packed messages that were shed under overload."
        )
        for kind in KINDS:
            self.samples.labels(kind)
        for reason in Reason:
            self.rejected.labels(reason)

    def _add_missing_messages(self) -> None:
        self.misses = self._counter(
            "dropanchor_missed_messages",
            "Messages that Zenoh noticed to be missing and did not recover. The service then asks the caches of the "
            "tag itself; what it does not get either is given up.",
        )
        self.given_up = self._counter(
            "dropanchor_given_up_messages",
            "Messages missing from a publisher's sequence that neither arrived in time nor were in its cache.",
        )
        self.sequence_restarts = self._counter(
            "dropanchor_sequence_restarts",
            "Publishers that went on with a number that is too far from their last one for missing messages.",
        )
        self.caught_up = self._counter(
            "dropanchor_caught_up_messages",
            "Messages that were suspended while the caches of their tag were queried, and then processed.",
        )

    def _add_estimators(self) -> None:
        duration = partial(Histogram, buckets=_SECONDS, registry=self.registry)
        self.poses = self._counter("dropanchor_poses", "Poses that the estimators produced.")
        faults = self._counter("dropanchor_faults", "Internal errors, by place.", ["where"])
        # All series begin at 0: Prometheus sees no increase in one that begins with its first count.
        self.faults: dict[FaultPlace, Counter] = {where: faults.labels(where) for where in get_args(FaultPlace)}
        self.estimator_seconds = duration("dropanchor_estimator_seconds", "Time to fuse one batch of samples.")
        self.delay_seconds = duration(
            "dropanchor_pose_delay_seconds",
            "Time from the arrival of the oldest message of a batch until its poses are in the store.",
        )
        self.clock_jumps = self._counter("dropanchor_clock_jumps", "Tag clocks that were set, or found to be off.")
        self.host_clock = Gauge(
            "dropanchor_host_clock_error_seconds",
            "How far the clock of this machine is ahead of that of its tags; 0 while they agree.",
            registry=self.registry,
        )

    def _add_checkpoints(self) -> None:
        self.checkpoints = Counter(
            "dropanchor_checkpoints", "Attempts to write a checkpoint, by outcome.", ["outcome"], registry=self.registry
        )
        self.checkpoint_age = Gauge(
            "dropanchor_checkpoint_age_seconds",
            "Age of the newest checkpoint: the time that a service must catch up on after a kill.",
            registry=self.registry,
        )
        self.checkpoint_bytes = Gauge(
            "dropanchor_checkpoint_bytes", "Size of the newest checkpoint.", registry=self.registry
        )
        for outcome in ("written", "failed"):
            self.checkpoints.labels(outcome)

    def register(self, collector: Collector) -> None:
        """Include the metrics of this collector in every scrape."""
        self.registry.register(collector)


class FleetGauges(Collector):
    """Gauges that are read from the store at every scrape."""

    def __init__(
        self,
        sites: Sites,
        latest: LatestPoses,
        now_ns: Callable[[], int],
        queue_depth: Callable[[], int],
    ) -> None:
        self._sites = sites
        self._latest = latest
        self._now_ns = now_ns
        self._queue_depth = queue_depth

    def collect(self) -> Iterable[Metric]:
        poses = self._latest.since()[1]
        aged = aged_poses(poses, self._sites.rows.overdue_s(poses, self._now_ns()))
        by_state = np.bincount(published_states(aged["state"], aged["frame"]), minlength=len(STATES))
        tags = GaugeMetricFamily("dropanchor_tags", "Tags that have a pose, by tracking state.", labels=["state"])
        for state, count in zip(STATES, by_state, strict=True):
            tags.add_metric([state], count)
        yield tags
        yield GaugeMetricFamily("dropanchor_tags_registered", "Tags that are registered.", len(self._sites.rows))
        pending = sum(len(site.pending_tags) for site in self._sites)
        what = "Pending tags: they have sent messages but are not registered."
        yield GaugeMetricFamily("dropanchor_tags_pending", what, pending)
        former = "The former name of dropanchor_tags_pending, until the next version."
        yield GaugeMetricFamily("dropanchor_newcomers", former, pending)
        yield GaugeMetricFamily(
            "dropanchor_tags_online",
            "Tags that are online: by a liveliness token, an open WebSocket, or HTTP.",
            sum(site.tags.presence.count() for site in self._sites),
        )
        yield GaugeMetricFamily("dropanchor_queue_messages", "Messages queued for the estimators.", self._queue_depth())
