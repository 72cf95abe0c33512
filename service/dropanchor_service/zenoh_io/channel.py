"""What a Zenoh channel holds, taken in one go: waiting gives up the interpreter, which has to be won back."""

import time
from collections.abc import Iterator
from typing import Any

import zenoh


def received(channel: Any, gather_s: float = 0.0) -> Iterator[Any]:
    """Until it is closed. gather_s: how long the first entry waits for others, so that one waking takes many."""
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
