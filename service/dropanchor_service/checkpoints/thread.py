"""Take snapshots between two turns of the ingest thread, when nothing changes, and write them on another thread."""

import logging
import threading
import time

from dropanchor_service.checkpoints.format import CheckpointError, Checkpoints, Snapshot
from dropanchor_service.checkpoints.snapshot import ServiceState
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.runtime.worker import Worker

OLD_S = 5.0  # a newest checkpoint that is so much older than the pause is a problem
WEAR_BYTES_S = 70_000  # a pause is so long that no more is written in a second: 2 TB a year spare a memory card
LONGEST_S = 6.0  # pause because of that: what tags without a cache send in a pause is lost if the service is killed
REST = 3  # pause, relative to the duration of the last write, so that a slow disk is not always busy
FIRST_S = 0.25  # pause before the first: of a tag that no checkpoint has, the caches are asked for 100 messages only
_TURN_S = 1.0  # wait for a turn of the ingest thread

_log = logging.getLogger(__name__)


class CheckpointThread(Worker):
    """Writes checkpoints on a thread of its own. The ingest thread calls `between_turns`."""

    def __init__(
        self, state: ServiceState, kept: Checkpoints, metrics: Metrics, period_s: float, clock: UtcClock
    ) -> None:
        super().__init__("checkpoints", _TURN_S)
        self._log = RareLog(_log)
        self._state = state
        self._kept = kept
        self._metrics = metrics
        self._period_s = period_s
        self._clock = clock
        self._requested = threading.Event()
        self._taken = threading.Event()
        self._snapshot: Snapshot | None = None
        self._messages = -1  # in the newest checkpoint
        self._current_s = time.monotonic()  # when the newest checkpoint, or the loaded one, was last up to date
        self._error: str | None = None
        self._pause_s = min(period_s, FIRST_S)
        metrics.checkpoint_age.set_function(lambda: self.age_s)

    def load(self) -> None:
        """Restore the newest checkpoint, if there is one, and log the result. Call it before the first message."""
        snapshot, complaints = self._kept.newest()
        for complaint in complaints:
            _log.warning("%s", complaint)
        if snapshot is None:
            _log.info("there is no usable checkpoint: all tags start afresh")
            return
        try:
            self._state.restore(snapshot)
        except CheckpointError as error:
            _log.warning("the newest checkpoint is not used: %s; all tags start afresh", error)
            return
        _log.info("going on from a checkpoint with %d tags", len(snapshot.document["tags"]))
        self._go_on_in_time(int(snapshot.arrays["counts"]["last_heard_ns"].max(initial=0)))

    def _go_on_in_time(self, heard_ns: int) -> None:
        """Let the service's clock go on from when the last message arrived, if the host shows an earlier time."""
        by_ns = self._clock.go_on_from(heard_ns)
        if by_ns:
            self._metrics.host_clock.set(-by_ns * 1e-9)
            _log.warning("%s", self._clock.problem)

    def start(self) -> None:
        self._current_s = time.monotonic()
        super().start()

    def stop(self) -> None:
        """Stop, and write the last checkpoint. Call it after the ingest thread has stopped."""
        super().stop()
        if self.is_alive:
            self._state.keep_buffers_apart()
        self._snapshot = None
        self._requested.set()
        self.between_turns()
        self._write()

    def stop_without_writing(self) -> None:
        """Stop, and leave the newest checkpoint as it is."""
        super().stop()

    @property
    def age_s(self) -> float:
        """Seconds of tracking that would be lost if the service were killed now."""
        return time.monotonic() - self._current_s

    @property
    def problem(self) -> str | None:
        """Return why a killed service would lose its state, None if it would not."""
        if self.age_s < self._pause_s + OLD_S:
            return None
        return f"the newest checkpoint is {self.age_s:.0f} s old: {self._error or 'no snapshot could be taken'}"

    def between_turns(self) -> None:
        """Copy the state if a snapshot is requested and messages have arrived since the last one."""
        if not self._requested.is_set():
            return
        self._requested.clear()
        try:
            self._take()
        finally:
            self._taken.set()

    def _take(self) -> None:
        messages, now_s = self._state.messages, time.monotonic()
        if messages == self._messages:
            self._current_s = now_s
        else:
            self._snapshot, self._of = self._state.snapshot(), (messages, now_s)

    def _run(self) -> None:
        while not self._stop.wait(self._pause_s):
            self._taken.clear()
            self._requested.set()
            # Request no other one before: a snapshot must not be overwritten while it is being written.
            while not self._taken.wait(_TURN_S):
                if self._stop.is_set():
                    return
            self._write()

    def _write(self) -> None:
        snapshot, self._snapshot = self._snapshot, None
        if snapshot is None:
            return
        began_s = time.monotonic()
        try:
            size = self._kept.write(snapshot)
        except CheckpointError as error:
            self._error = str(error)
            self._metrics.checkpoints.labels("failed").inc()
            self._log.warning("checkpoint", str(error))
            return
        except Exception as error:
            self._error = error.strerror or str(error) if isinstance(error, OSError) else str(error)
            self._metrics.checkpoints.labels("failed").inc()
            self._log.exception("checkpoint", error)
            return
        took_s = time.monotonic() - began_s  # of a write that failed it says nothing: it may have waited in vain
        if self._of[0]:  # messages: the next checkpoint is not the first one with tags
            self._pause_s = max(self._period_s, REST * took_s, min(LONGEST_S, size / WEAR_BYTES_S))
        self._messages, self._current_s = self._of
        self._metrics.checkpoints.labels("written").inc()
        self._metrics.checkpoint_bytes.set(size)
