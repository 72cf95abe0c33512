"""Drain a Zenoh channel in batches.

Each wait releases the interpreter lock, and getting it back takes time. A batch pays that once for many entries.
"""

from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from typing import Any

import zenoh

MANY = 3  # entries of a batch, from which on the next one hardly comes without any


def drain(channel: Any, gather: Callable[[bool], None] = lambda _: None) -> Iterator[Any]:
    """Yield the entries of a channel until it is closed.

    gather: called after the first entry of a batch, to wait for more. While MANY come in a batch, nobody waits for the
    first one of the next: to be woken costs more than to look. Then it is called with False, before the batch.
    """
    count = 0
    with suppress(zenoh.ZError):
        while True:
            if count < MANY:
                entry = channel.recv()
                gather(True)
                yield entry
            else:
                gather(False)
            count = yield from drain_now(channel)


def drain_now(channel: Any) -> Generator[Any, None, int]:
    """Yield the entries that a channel has now. Return how many. Raises ZError if there are none and it is closed."""
    count = 0
    while (entry := channel.try_recv()) is not None:
        yield entry
        count += 1
    return count
