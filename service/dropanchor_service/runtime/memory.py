"""Memory that was needed for a moment goes back to the system.

The allocator of glibc gives back only the end of each of its arenas: after a burst of messages the rest would stay with
the process for good, and the next burst, in another arena, would come on top of it.
"""

import ctypes
import time
from collections.abc import Callable

PERIOD_S = 60.0


class SpareMemory:
    """Owned by one thread. Does nothing where the C library has no malloc_trim(3)."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._given_back_s = now_s()
        self._trim = getattr(ctypes.CDLL(None), "malloc_trim", None)

    def give_back(self) -> bool:
        """Once in PERIOD_S, however often it is called; True when it did. Other threads run meanwhile."""
        if self._trim is None or self._now_s() - self._given_back_s < PERIOD_S:
            return False
        self._given_back_s = self._now_s()
        self._trim(ctypes.c_size_t(0))
        return True
