"""Say ever more rarely that something still fails."""

import math
import time
from collections.abc import Callable

_FIRST_PAUSE_S, _LAST_PAUSE_S = 10.0, 3600.0


class Reminders:
    """When to say once more that something still fails: after 10 s, then after twice as long each time, up to an hour.

    attempts: how many have failed.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._next_s, self._pause_s = -math.inf, _FIRST_PAUSE_S
        self.attempts = 0

    def failed(self) -> bool:
        """Count a failed attempt. Return whether to say so now."""
        self.attempts += 1
        now_s = self._clock()
        if now_s < self._next_s:
            return False
        self._next_s, self._pause_s = now_s + self._pause_s, min(2 * self._pause_s, _LAST_PAUSE_S)
        return True

    @property
    def words(self) -> str:
        """What is done about it, such as `Still trying (attempt 12)`."""
        return "Still trying" if self.attempts == 1 else f"Still trying (attempt {self.attempts:,})"
