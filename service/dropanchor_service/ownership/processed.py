"""Wait until the ingest has processed what waits for it."""

from collections.abc import Callable
from threading import Event

FEW = 100  # messages: the next turn takes all of them
TURN_S = 1.5  # to wait for a turn, at most


class Processed:
    """The ingest thread calls `between_turns`. depth: of messages that wait. wake: lets the next turn begin at once."""

    def __init__(self, depth: Callable[[], int], wake: Callable[[], None]) -> None:
        self._depth = depth
        self._wake = wake
        self._keeps_up = Event()

    def between_turns(self) -> None:
        """Note that a turn has ended."""
        if self._depth() < FEW:
            self._keeps_up.set()

    def wait(self) -> None:
        """Return once what waits now has become poses, or after two times TURN_S.

        The first turn that ends may have begun before.
        """
        for _ in range(2):
            self._keeps_up.clear()
            self._wake()
            self._keeps_up.wait(TURN_S)
