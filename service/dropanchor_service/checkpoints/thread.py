"""Takes snapshots between two turns of the ingest thread, where nothing changes, and writes them on another."""

import logging
import threading
import time

from dropanchor_service.checkpoints.files import CheckpointFolder, Snapshot
from dropanchor_service.checkpoints.snapshot import ServiceState
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog

OLD_S = 5.0  # beyond it the age of the newest checkpoint is a problem
REST = 3  # times as long as it took to write the last one: a slow disk gets more time to itself
_TURN_S = 1.0  # for the ingest thread to come round

_log = logging.getLogger(__name__)


class CheckpointThread:
    """A thread of its own between `start` and `stop`. `between_turns` is called by the ingest thread."""

    def __init__(self, state: ServiceState, folder: CheckpointFolder, metrics: Metrics, period_s: float) -> None:
        self._log = RareLog(_log)
        self._state = state
        self._folder = folder
        self._metrics = metrics
        self._period_s = period_s
        self._wanted = threading.Event()
        self._taken = threading.Event()
        self._stop = threading.Event()
        self._snapshot: Snapshot | None = None
        self._messages = -1  # in the newest checkpoint
        self._current_s = time.monotonic()  # when the newest checkpoint, or what was loaded, was all there was
        self._error: str | None = None
        self._took_s = 0.0
        self._thread = threading.Thread(target=self._run, name="checkpoints", daemon=True)
        metrics.checkpoint_age.set_function(lambda: self.age_s)

    def load(self) -> None:
        """Take over the newest checkpoint, and say what became of it. Before anything has come in."""
        snapshot, complaints = self._folder.newest()
        for complaint in complaints:
            _log.warning("%s", complaint)
        if snapshot is None:
            _log.info("there is no checkpoint to go on from: all tags start afresh")
            return
        self._state.restore(snapshot)
        _log.info("going on from a checkpoint with %d tags", len(snapshot.document["tags"]))

    def start(self) -> None:
        self._current_s = time.monotonic()
        self._thread.start()

    def stop(self) -> None:
        """Writes the last checkpoint. The ingest thread has stopped."""
        self._stop.set()
        self._thread.join(_TURN_S)
        if self._thread.is_alive():
            self._state.keep_buffers_apart()
        self._snapshot = None
        self._wanted.set()
        self.between_turns()
        self._write()

    @property
    def is_alive(self) -> bool:
        return self._thread.is_alive()

    @property
    def age_s(self) -> float:
        """How much of the past a killed service would have to make up for."""
        return time.monotonic() - self._current_s

    @property
    def problem(self) -> str | None:
        """Why a killed service could not go on from here; None when it could."""
        if self.age_s < OLD_S:
            return None
        return f"the newest checkpoint is {self.age_s:.0f} s old: {self._error or 'none could be taken'}"

    def between_turns(self) -> None:
        """Copies the state if one is wanted, and something has come in since the last."""
        if not self._wanted.is_set():
            return
        self._wanted.clear()
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
        while not self._stop.wait(max(self._period_s, REST * self._took_s)):
            self._taken.clear()
            self._wanted.set()
            # Not asked for again before it was taken: a snapshot must not be overwritten while it is written.
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
            size = self._folder.write(snapshot)
        except Exception as error:
            self._error = error.strerror or str(error) if isinstance(error, OSError) else str(error)
            self._metrics.checkpoints.labels("failed").inc()
            self._log.exception("checkpoint", error)
            return
        finally:
            self._took_s = time.monotonic() - began_s
        self._messages, self._current_s = self._of
        self._metrics.checkpoints.labels("written").inc()
        self._metrics.checkpoint_bytes.set(size)
