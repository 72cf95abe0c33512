"""Publish from a thread of its own."""

import logging
from abc import abstractmethod

from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.runtime.may_serve import MayServe, always
from dropanchor_service.runtime.worker import Worker


class PeriodicPublisher(Worker):
    """Calls `publish` every `period_s` while it is open. An error is counted and logged, and the calls go on.

    The ingest thread must not publish, because a put may take longer than it can wait. may_publish: asked before each
    call.
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
        while not self._stop.wait(self._period_s):
            if not self._may_publish():
                continue
            try:
                self.publish()
            except Exception as error:
                self._metrics.faults.labels("publication").inc()
                self._log.exception(f"publication of {self._name}", error)
