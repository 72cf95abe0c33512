"""Run the ingest on a thread of its own, which survives errors and reports when it is stuck."""

import logging
import time
from collections.abc import Callable

from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.period import Period
from dropanchor_service.ingest.turn import Ingest
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.runtime.may_serve import MayServe, always
from dropanchor_service.runtime.worker import Worker

IDLE_S = 0.25  # between two turns without messages
CALM_S = 2.0  # without messages, after which turns are CALM_IDLE_S apart
CALM_IDLE_S = 1.0
PENDING_S = 0.02  # longest wait while messages are pending, which may become due
BACKLOG = 1000  # messages from which on a turn starts at once
SILENT_S = 5.0  # without a turn: then the thread counts as stuck
TURN_S = 0.1  # duration of a turn to aim at when there is a backlog
MIN_MESSAGES, MAX_MESSAGES = 100, 2000  # limits of such a turn
MIN_MEASURED = 50  # messages of a turn whose duration predicts that of the next one


class IngestThread(Worker):
    """Takes a turn every `period.current_s` while messages arrive, and while `may_turn`.

    between_turns: called after each turn, on the same thread.
    """

    def __init__(
        self,
        ingest: Ingest,
        buffer: MessageBuffer,
        metrics: Metrics,
        period: Period,
        between_turns: Callable[[], None] = lambda: None,
        may_turn: MayServe = always,
    ) -> None:
        super().__init__("ingest")
        self._log = RareLog(logging.getLogger(__name__))
        self._ingest = ingest
        self._buffer = buffer
        self._metrics = metrics
        self._period = period
        self._between_turns = between_turns
        self._may_turn = may_turn
        self._turned_s = self._heard_s = time.monotonic()
        self._limit = MIN_MESSAGES

    @property
    def problem(self) -> str | None:
        """Return why samples are not fused now, None if they are."""
        if not self.is_alive:
            return "the ingest thread is not running"
        silent_s = time.monotonic() - self._turned_s
        return f"the ingest thread has been stuck for {silent_s:.0f} s" if silent_s > SILENT_S else None

    def _run(self) -> None:
        self._turn()  # admits the listed tags before the first message
        while not self._stop.is_set():
            if self._buffer.depth < BACKLOG and not self._buffer.behind:
                # Gather messages, so that one call fuses many of them. What arrives meanwhile wakes nobody.
                self._stop.wait(self._turned_s + self._period.current_s - time.monotonic())
            if self._buffer.wait(self._longest_wait_s()):
                self._heard_s = time.monotonic()
            self._turn()
        self._turn()  # fuses what arrived before the stop

    def _longest_wait_s(self) -> float:
        if self._ingest.has_pending:
            return PENDING_S
        return IDLE_S if time.monotonic() - self._heard_s < CALM_S else CALM_IDLE_S

    def _turn(self) -> None:
        before_s, self._turned_s = self._turned_s, time.monotonic()
        if not self._may_turn():
            self._stop.wait(IDLE_S)
            return
        try:
            taken = self._ingest.turn(self._limit)
            self._period.adapt(taken, self._turned_s - before_s, self._ingest.span_s)
            if taken >= MIN_MEASURED:
                self._adapt(taken / (time.monotonic() - self._turned_s))
            self._between_turns()
        except Exception as error:
            self._metrics.faults["ingest"].inc()
            self._log.exception("ingest", error)
            self._stop.wait(self._period.current_s)

    def _adapt(self, messages_per_s: float) -> None:
        self._limit = min(max(round(TURN_S * messages_per_s), MIN_MESSAGES), MAX_MESSAGES)
