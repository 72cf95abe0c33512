"""What is not used, counted by cause: for its tag, and in the metrics."""

import logging

from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import Array
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.store import TagTable


class Rejections:
    """Owned by one thread."""

    def __init__(self, tags: TagTable, metrics: Metrics) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._tags = tags
        self._metrics = metrics

    def reject(self, reason: Reason, rows: Array) -> None:
        """A message or sample of each of `rows`."""
        if len(rows):
            self._tags.count_rejected(reason, rows)
            self._metrics.rejected.labels(reason).inc(len(rows))

    def refuse(self, reason: Reason, key: str) -> None:
        """A message of nobody who is known."""
        self._metrics.rejected.labels(reason).inc()
        self._log.warning(f"message refused ({reason})", key[:200])

    def shed(self, rows: Array, samples: int) -> None:
        """A message of each of `rows`, in all with so many samples."""
        self.reject(Reason.SHED, rows)
        self._metrics.shed_samples.inc(samples)

    def count_unregistered(self, reason: Reason, messages: int) -> None:
        """Messages of tags without a row."""
        self._metrics.rejected.labels(reason).inc(messages)

    def give_up(self, messages: int) -> None:
        """Messages that were waited for and did not come."""
        if messages:
            self._metrics.given_up.inc(messages)

    def clocks_jumped(self, times: int) -> None:
        """Clocks of tags that were set, and whose samples go on without the jump."""
        if times:
            self._metrics.clock_jumps.inc(times)

    def observer_failed(self, error: Exception) -> None:
        """An error of ours."""
        self._metrics.faults.labels("tap").inc()
        self._log.exception("tap", error)

    def decoder_failed(self, error: Exception) -> None:
        """An error of ours."""
        self._metrics.faults.labels("decoder").inc()
        self._log.exception("decoder", error)
