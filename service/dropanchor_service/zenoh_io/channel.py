"""Drain a Zenoh channel in batches.

Each wait releases the interpreter lock, and getting it back takes time. A batch pays that once for many entries.
"""

from collections.abc import Callable, Iterator
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
        while entry is not None:
            yield entry
            entry = _next(channel)


def _next(channel: Any) -> Any:
    try:
        return channel.try_recv()
    except zenoh.ZError:
        return None
