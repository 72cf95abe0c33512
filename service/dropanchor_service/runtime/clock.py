"""The service's clock."""

import time


class UtcClock:
    """UTC of the host at the start, advanced by the monotonic clock. Later steps of the host's clock have no effect."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Return the current UTC in ns."""
        return time.monotonic_ns() + self._offset_ns
