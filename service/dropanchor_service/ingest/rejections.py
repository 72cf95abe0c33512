"""Count what is not used by reason, for its tag and in the metrics."""

import logging

from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import Array
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.store import Rows


class Rejections:
    """Counters of rejected messages and samples, and of faults. Owned by one thread."""

    def __init__(self, rows: Rows, metrics: Metrics) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._rows = rows
        self._metrics = metrics

    def count_rejected(self, reason: Reason, rows: Array, what: str | None = None) -> None:
        """Count a rejected message or sample for each entry of `rows`.

        what: the kind of samples that do not reach the engine, or MESSAGE for unreadable messages.
        """
        if len(rows):
            if what is not None:
                self._rows.count_screened(what, rows)
            self._rows.count_rejected(reason, rows)
            self._metrics.rejected.labels(reason).inc(len(rows))

    def count_refused(self, reason: Reason, key: str) -> None:
        """Count and log a rejected message of a tag without a row."""
        self._metrics.rejected.labels(reason).inc()
        self._log.warning(f"a message is rejected ({reason})", key[:200])

    def count_shed(self, rows: Array, samples: int) -> None:
        """Count a shed message for each entry of `rows`, with `samples` packed samples in total."""
        self.count_rejected(Reason.SHED, rows)
        self._metrics.shed_samples.inc(samples)

    def count_unregistered(self, reason: Reason, messages: int) -> None:
        """Count rejected messages of tags without a row."""
        if messages:
            self._metrics.rejected.labels(reason).inc(messages)

    def count_given_up(self, messages: int) -> None:
        """Count missing messages that the service no longer waits for."""
        if messages:
            self._metrics.given_up.inc(messages)

    def count_restarts(self, times: int) -> None:
        """Count publishers that went on with a number that cannot follow their last one."""
        if times:
            self._metrics.sequence_restarts.inc(times)

    def count_clock_jumps(self, times: int) -> None:
        """Count jumps of tags' clocks, which are removed from the times of the samples."""
        if times:
            self._metrics.clock_jumps.inc(times)

    def observer_failed(self, error: Exception) -> None:
        """Count and log an error in an observer."""
        self._metrics.faults["observer"].inc()
        self._log.exception("observer", error)

    def decoder_failed(self, error: Exception) -> None:
        """Count and log an error in the decoder."""
        self._metrics.faults["decoder"].inc()
        self._log.exception("decoder", error)
