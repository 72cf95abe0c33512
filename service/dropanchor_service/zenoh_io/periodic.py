"""Publish from a thread of its own."""

import logging
import threading
from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self

from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog


class PeriodicPublisher(ABC):
    """Calls `publish` every `period_s` while it is open. An error is counted and logged, and the calls go on.

    The ingest thread must not publish, because a put may take longer than it can wait.
    """

    def __init__(self, name: str, period_s: float, metrics: Metrics) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._name = name
        self._period_s = period_s
        self._metrics = metrics
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @abstractmethod
    def publish(self) -> None:
        """Put what has changed since the last call."""

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join(1.0)

    def _run(self) -> None:
        while not self._stop.wait(self._period_s):
            try:
                self.publish()
            except Exception as error:
                self._metrics.faults.labels("publication").inc()
                self._log.exception(f"publication of {self._name}", error)
