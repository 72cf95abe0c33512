"""How often one client may ask: a token bucket each."""

import time
from collections import OrderedDict
from collections.abc import Callable

MOST = 10_000  # clients that are remembered; the one that was silent for the longest is forgotten first


class RateLimiter:
    """Each holds `burst` tokens and gains `per_s` a second."""

    def __init__(self, per_s: float, burst: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._per_s = per_s
        self._burst = burst
        self._clock = clock
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()  # tokens left, at that time

    def wait_s(self, client: str) -> float:
        """Takes a token of this client's: 0, or how long until there is one."""
        now_s = self._clock()
        left, then_s = self._buckets.pop(client, (float(self._burst), now_s))
        left = min(self._burst, left + (now_s - then_s) * self._per_s)
        allowed = left >= 1.0
        self._buckets[client] = (left - 1.0 if allowed else left, now_s)
        if len(self._buckets) > MOST:
            self._buckets.popitem(last=False)
        return 0.0 if allowed else (1.0 - left) / self._per_s
