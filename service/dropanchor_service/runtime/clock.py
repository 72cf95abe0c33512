"""Our own UTC."""

import time


class UtcClock:
    """UTC as the host had it at the start, carried on by its monotonic clock: steps of the host's clock do nothing."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        return time.monotonic_ns() + self._offset_ns
