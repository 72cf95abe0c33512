"""Drain a Zenoh channel in batches.

Each wait releases the interpreter lock, and getting it back takes time. A batch pays that once for many entries.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import zenoh


def drain(channel: Any, gather: Callable[[], None] = lambda: None) -> Iterator[Any]:
    """Yield the entries of a channel until it is closed.

    gather: called after the first entry of a batch, to wait for more.
    """
    while True:
        try:
            entry = channel.recv()
        except zenoh.ZError:
            return
        gather()
        yield entry
        with suppress(zenoh.ZError):
            yield from drain_now(channel)


def drain_now(channel: Any) -> Iterator[Any]:
    """Yield the entries that a channel has now. Raises ZError if there are none and it is closed."""
    while (entry := channel.try_recv()) is not None:
        yield entry
