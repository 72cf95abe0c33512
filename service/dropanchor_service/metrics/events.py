"""Metrics of events and webhooks."""

import sqlite3
from collections.abc import Iterable

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.events.store import EventStore
from dropanchor_service.events.thread import EventThread
from dropanchor_service.webhooks.thread import WebhookThread


class EventMetrics(Collector):
    """Metrics that are read from the events and the queues at every scrape."""

    def __init__(self, thread: EventThread, store: EventStore, deliveries: Deliveries, webhooks: WebhookThread) -> None:
        self._thread = thread
        self._store = store
        self._deliveries = deliveries
        self._webhooks = webhooks

    def collect(self) -> Iterable[Metric]:
        thread, counts = self._thread, self._webhooks.counts
        yield CounterMetricFamily("dropanchor_events", "Events stored.", thread.stored)
        yield CounterMetricFamily(
            "dropanchor_events_busy_seconds", "CPU time of finding and storing events.", thread.busy_s
        )
        yield GaugeMetricFamily("dropanchor_events_failing", "1 while events cannot be stored.", bool(thread.problem))
        yield CounterMetricFamily("dropanchor_webhook_delivered", "Events delivered to webhooks.", counts.delivered)
        yield CounterMetricFamily(
            "dropanchor_webhook_failed_attempts", "Attempts to deliver an event that failed.", counts.failed_attempts
        )
        yield CounterMetricFamily(
            "dropanchor_webhook_dropped",
            "Events deleted by age or size before their webhook had them.",
            self._store.dropped_deliveries,
        )
        yield from self._queues()

    def _queues(self) -> Iterable[Metric]:
        try:
            queued = self._deliveries.counts().values()
        except sqlite3.Error:
            return
        pending, dead = sum(counts[0] for counts in queued), sum(counts[1] for counts in queued)
        yield GaugeMetricFamily("dropanchor_webhook_pending", "Events that wait for delivery.", pending)
        yield GaugeMetricFamily("dropanchor_webhook_dead_letters", "Events whose delivery was given up.", dead)
