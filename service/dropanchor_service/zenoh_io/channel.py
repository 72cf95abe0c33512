"""Drain a Zenoh channel in batches.

Each wait releases the interpreter lock, and getting it back takes time. A batch pays that once for many entries.
"""

import time
from collections.abc import Iterator
from typing import Any

import zenoh


def drain(channel: Any, gather_s: float = 0.0) -> Iterator[Any]:
    """Yield the entries of a channel until it is closed.

    gather_s: how long to wait for more entries after the first one of a batch.
    """
    while True:
        try:
            entry = channel.recv()
        except zenoh.ZError:
            return
        if gather_s:
            time.sleep(gather_s)
        while entry is not None:
            yield entry
            entry = _next(channel)


def _next(channel: Any) -> Any:
    try:
        return channel.try_recv()
    except zenoh.ZError:
        return None
