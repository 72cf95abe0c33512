"""Publish from a thread of its own, which sleeps until there is something new."""

import logging
import time
from abc import abstractmethod

from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.runtime.may_serve import MayServe, always
from dropanchor_service.runtime.worker import Worker


class PeriodicPublisher(Worker):
    """Calls `publish` after each `wake` while it is open, but not twice within `period_s`.

    An error is counted and logged, and the call is repeated. The ingest thread must not publish, because a put may take
    longer than it can wait. may_publish: asked before each call.
    """

    def __init__(self, name: str, period_s: float, metrics: Metrics, may_publish: MayServe = always) -> None:
        super().__init__(name)
        self._log = RareLog(logging.getLogger(__name__))
        self._name = name
        self._period_s = period_s
        self._metrics = metrics
        self._may_publish = may_publish

    @abstractmethod
    def publish(self) -> None:
        """Put what has changed since the last call."""

    def _run(self) -> None:
        while self._news.wait() and not self._stop.is_set():
            due_s = time.monotonic() + self._period_s
            if self._may_publish():
                self._news.clear()
                self._attempt()
            self._stop.wait(max(0.0, due_s - time.monotonic()))

    def _attempt(self) -> None:
        try:
            self.publish()
        except Exception as error:
            self.wake()
            self._metrics.faults["publication"].inc()
            self._log.exception(f"publication of {self._name}", error)
