"""Return unused heap memory to the system.

The allocator of glibc returns only the end of each arena. After a burst of messages the process would keep the rest,
and the next burst in another arena would add to it.
"""

import ctypes
import time
from collections.abc import Callable

PERIOD_S = 60.0


class HeapTrimmer:
    """Calls malloc_trim(3) now and then; does nothing where the C library lacks it. Not thread-safe."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._trimmed_s = now_s()
        self._malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)

    def trim(self) -> bool:
        """Trim the heap if the last time was PERIOD_S ago. Return whether it did. Other threads run meanwhile."""
        if self._malloc_trim is None or self._now_s() - self._trimmed_s < PERIOD_S:
            return False
        self._trimmed_s = self._now_s()
        self._malloc_trim(ctypes.c_size_t(0))
        return True
