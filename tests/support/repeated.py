"""Do something again and again while a test does something else."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from threading import Event, Thread


@contextmanager
def repeated(act: Callable[[int], object], period_s: float) -> Iterator[None]:
    """Call `act` with 0, 1, 2, … on a thread of its own, one call each period, until the block ends.

    A call that is late does not delay the following ones.
    """
    stop = Event()

    def run() -> None:
        began_s = time.monotonic()
        for index in count():
            if stop.wait(max(0.0, began_s + index * period_s - time.monotonic())):
                return
            act(index)

    thread = Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
