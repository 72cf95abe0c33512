"""Turn Ctrl-C and SIGTERM into an event that the main thread waits for."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

CHECK_S = 0.5


class Interrupt:
    """An event that the first signal sets. A second signal ends the process immediately."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self._raises = False

    @contextmanager
    def raising(self) -> Iterator[None]:
        """Let a signal raise KeyboardInterrupt in this context: for long work that needs no cleanup."""
        self._raises = True
        try:
            yield
        finally:
            self._raises = False

    def wait(self, keep_waiting: Callable[[], bool]) -> bool:
        """Wait for a signal and return True. Return False when `keep_waiting` returns False first."""
        while not self._event.wait(CHECK_S):
            if not keep_waiting():
                return self._event.is_set()
        return True

    def wait_for(self, seconds: float) -> bool:
        """Wait for a signal at most so long. Return whether one came."""
        return self._event.wait(seconds)

    def on_signal(self, number: int, _frame: FrameType | None) -> None:
        """Handle a signal."""
        if self._event.is_set():
            os._exit(128 + number)
        self._event.set()
        if self._raises:
            raise KeyboardInterrupt


@contextmanager
def interrupts() -> Iterator[Interrupt]:
    """Handle SIGINT and SIGTERM in this context; restore the former handlers after it."""
    interrupt = Interrupt()
    before = {number: signal.signal(number, interrupt.on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield interrupt
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
