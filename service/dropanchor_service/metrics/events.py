"""Metrics of events and their delivery, of all sites together."""

import sqlite3
from collections.abc import Callable, Iterable, Sequence

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from dropanchor_service.delivery.thread import DeliveryThread, Outbox
from dropanchor_service.events.deliveries import QueueState
from dropanchor_service.events.thread import EventThread


class EventMetrics(Collector):
    """Metrics that are read from the events and the queues at every scrape."""

    def __init__(
        self,
        thread: EventThread,
        outboxes: Sequence[Outbox],
        delivery: DeliveryThread,
        now_ns: Callable[[], int],
    ) -> None:
        self._thread = thread
        self._outboxes = outboxes
        self._delivery = delivery
        self._now_ns = now_ns

    def collect(self) -> Iterable[Metric]:
        thread, counts = self._thread, self._delivery.counts
        yield CounterMetricFamily("dropanchor_events", "Events stored.", thread.stored)
        yield CounterMetricFamily(
            "dropanchor_events_busy_seconds", "CPU time of finding and storing events.", thread.busy_s
        )
        yield GaugeMetricFamily("dropanchor_events_failing", "1 while events cannot be stored.", bool(thread.problems))
        yield CounterMetricFamily("dropanchor_delivery_delivered", "Events delivered.", counts.delivered)
        yield CounterMetricFamily(
            "dropanchor_delivery_failed_attempts", "Attempts to deliver an event that failed.", counts.failed_attempts
        )
        yield CounterMetricFamily(
            "dropanchor_delivery_dropped",
            "Events deleted by age or size before their destination had them.",
            sum(one.store.dropped_deliveries for one in self._outboxes),
        )
        yield from self._queues()

    def _queues(self) -> Iterable[Metric]:
        try:
            states = [state for one in self._outboxes for state in one.deliveries.states().values()]
        except sqlite3.Error:
            return
        pending, dead = sum(state.pending for state in states), sum(state.dead for state in states)
        yield GaugeMetricFamily("dropanchor_delivery_pending", "Events that wait for delivery.", pending)
        yield GaugeMetricFamily("dropanchor_delivery_dead_letters", "Events whose delivery was given up.", dead)
        yield GaugeMetricFamily(
            "dropanchor_delivery_age_seconds", "Age of the oldest event that waits for delivery.", self._age_s(states)
        )

    def _age_s(self, states: Iterable[QueueState]) -> float:
        oldest = [state.oldest_ns for state in states if state.oldest_ns is not None]
        return max(0.0, (self._now_ns() - min(oldest)) * 1e-9) if oldest else 0.0
