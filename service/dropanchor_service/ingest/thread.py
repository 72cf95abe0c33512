"""The only thread that runs engine. It survives errors, and says so when it does not."""

import logging
import threading
import time
from collections.abc import Callable

from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.turn import Ingest
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog

IDLE_S = 0.25
PENDING_S = 0.02  # of waiting while a held message may become due
BACKLOG = 1000  # messages beyond which there is no waiting for more
SILENT_S = 5.0  # without a turn the thread counts as stuck
TURN_S = 0.1  # that a turn may take when more waits than it takes
FEWEST, MOST = 100, 2000  # messages of such a turn
TELLING = 50  # messages of a turn from which on its time tells what another one will take


class IngestThread:
    """Takes a turn every `period_s` while messages come in, from the beginning of one to that of the next."""

    def __init__(
        self,
        ingest: Ingest,
        buffer: MessageBuffer,
        metrics: Metrics,
        period_s: float,
        between_turns: Callable[[], None] = lambda: None,
    ) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._ingest = ingest
        self._buffer = buffer
        self._metrics = metrics
        self._period_s = period_s
        self._between_turns = between_turns
        self._stop = threading.Event()
        self._turned_s = time.monotonic()
        self._most = FEWEST
        self._thread = threading.Thread(target=self._run, name="ingest", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self, timeout_s: float = 1.0) -> None:
        self._stop.set()
        self._thread.join(timeout_s)

    @property
    def is_alive(self) -> bool:
        return self._thread.is_alive()

    @property
    def problem(self) -> str | None:
        """Why samples are not fused at this moment; None when they are."""
        if not self.is_alive:
            return "the ingest thread does not run"
        silent_s = time.monotonic() - self._turned_s
        return f"the ingest thread has been stuck for {silent_s:.0f} s" if silent_s > SILENT_S else None

    def _run(self) -> None:
        self._turn()  # tags that are known are admitted before anything comes in
        while not self._stop.is_set():
            if self._buffer.wait(PENDING_S if self._ingest.has_pending else IDLE_S) and self._buffer.depth < BACKLOG:
                # so that one call fuses many messages
                self._stop.wait(self._turned_s + self._period_s - time.monotonic())
            self._turn()
        self._turn()  # what has come in before the end

    def _turn(self) -> None:
        self._turned_s = time.monotonic()
        try:
            taken = self._ingest.turn(self._most)
            if taken >= TELLING:
                self._adapt(taken / (time.monotonic() - self._turned_s))
            self._between_turns()
        except Exception as error:
            self._metrics.faults.labels("ingest").inc()
            self._log.exception("ingest", error)
            self._stop.wait(self._period_s)

    def _adapt(self, messages_per_s: float) -> None:
        self._most = min(max(round(TURN_S * messages_per_s), FEWEST), MOST)
