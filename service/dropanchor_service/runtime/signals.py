"""Ctrl-C and SIGTERM as an event that the main thread waits for."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

CHECK_S = 0.5


class Interrupt:
    """Set by the first signal; the second ends the process at once."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self._raises = False

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """While it is open a signal raises KeyboardInterrupt: for long work that leaves nothing behind."""
        self._raises = True
        try:
            yield
        finally:
            self._raises = False

    def wait(self, goes_on: Callable[[], bool]) -> bool:
        """Until a signal comes; False when `goes_on` has become false before."""
        while not self._event.wait(CHECK_S):
            if not goes_on():
                return self._event.is_set()
        return True

    def on_signal(self, number: int, _frame: FrameType | None) -> None:
        if self._event.is_set():
            os._exit(128 + number)
        self._event.set()
        if self._raises:
            raise KeyboardInterrupt


@contextmanager
def interrupts() -> Iterator[Interrupt]:
    """Signals are ours while it is open."""
    interrupt = Interrupt()
    before = {number: signal.signal(number, interrupt.on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield interrupt
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
