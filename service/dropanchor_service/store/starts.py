"""What becomes of the starts that people tell: told, confirmed by the ranges, denied by them, or at an end."""

from collections import deque
from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple


class StartPhase(IntEnum):
    """TOLD: the tag starts there again, or its settings no longer have a start (its place is empty).

    RESUMED: it goes on from a checkpoint. CONFIRMED: the ranges agree so far. SETTLED: they have agreed for so long a
    way that they no longer deny the start. DENIED: they contradict it. ENDED: the tag was lost; nobody knows whether
    the start was right.
    """

    TOLD = 0
    RESUMED = 1
    CONFIRMED = 2
    SETTLED = 3
    DENIED = 4
    ENDED = 5


class StartNews(NamedTuple):
    """place, before: the start in the settings as text, and the one that it replaced; empty: none."""

    row: int
    phase: StartPhase
    place: str = ""
    before: str = ""


class StartNewsQueue:
    """Takes the news from the ingest thread to the one that watches for events."""

    def __init__(self) -> None:
        self._waiting: deque[StartNews] = deque()
        self.on_change: list[Callable[[], None]] = []  # called after every addition, on the thread that makes it

    def append(self, news: StartNews) -> None:
        self._waiting.append(news)
        for told in self.on_change:
            told()

    def take(self) -> list[StartNews]:
        """Remove what waits, and return it in order."""
        return [self._waiting.popleft() for _ in range(len(self._waiting))]
