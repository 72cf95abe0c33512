"""Turn Ctrl-C and SIGTERM into an event that the main thread waits for, and SIGHUP into a wish to reload.

SIGHUP also says that the terminal has closed: a program that was started in one then ends as on SIGTERM.
"""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

CHECK_S = 0.5
HANGUP: signal.Signals | None = getattr(signal, "SIGHUP", None)  # Windows has none


class Interrupt:
    """An event that the first signal sets. A second signal ends the process immediately."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self._raises = False
        self._reloads = False
        is_ignored = HANGUP is not None and signal.getsignal(HANGUP) is signal.SIG_IGN  # as nohup wants it
        self._in_terminal = _has_terminal() and not is_ignored

    @contextmanager
    def raising(self) -> Iterator[None]:
        """Let a signal raise KeyboardInterrupt in this context: for long work that needs no cleanup."""
        self._raises = True
        try:
            yield
        finally:
            self._raises = False

    def wait(self, keep_waiting: Callable[[], bool], reload: Callable[[], object] | None = None) -> bool:
        """Wait for a signal and return True. Return False when `keep_waiting` returns False first.

        reload: called after SIGHUP.
        """
        while not self._event.wait(CHECK_S):
            if self._reloads and reload is not None:
                self._reloads = False
                if self._lost_terminal():  # it may have gone a moment after the signal
                    return True
                reload()
            if not keep_waiting():
                return self._event.is_set()
        return True

    def wait_for(self, seconds: float) -> bool:
        """Wait for a signal at most so long. Return whether one came."""
        return self._event.wait(seconds)

    def on_hangup(self, number: int, frame: FrameType | None) -> None:
        """Handle SIGHUP."""
        if self._lost_terminal():
            self.on_signal(number, frame)
        else:
            self._reloads = True

    def _lost_terminal(self) -> bool:
        return self._in_terminal and not _has_terminal()

    def on_signal(self, number: int, _frame: FrameType | None) -> None:
        """Handle a signal."""
        if self._event.is_set():
            os._exit(128 + number)
        self._event.set()
        if self._raises:
            raise KeyboardInterrupt


@contextmanager
def interrupts() -> Iterator[Interrupt]:
    """Handle SIGINT, SIGTERM and SIGHUP in this context; restore the former handlers after it."""
    interrupt = Interrupt()
    handlers: dict[int, Callable[[int, FrameType | None], None]] = {}
    handlers |= dict.fromkeys((signal.SIGINT, signal.SIGTERM), interrupt.on_signal)
    handlers |= {} if HANGUP is None else {HANGUP: interrupt.on_hangup}
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield interrupt
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _has_terminal() -> bool:
    """Return whether this process has a terminal that is still there."""
    return any(map(os.isatty, (0, 1, 2)))
