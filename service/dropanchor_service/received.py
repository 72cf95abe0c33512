"""What a Zenoh channel holds, taken in one go: waiting gives up the interpreter, which has to be won back."""

from collections.abc import Iterator
from typing import Any

import zenoh


def received(channel: Any) -> Iterator[Any]:
    """Until it is closed."""
    while True:
        try:
            entry = channel.recv()
        except zenoh.ZError:
            return
        while entry is not None:
            yield entry
            entry = _next(channel)


def _next(channel: Any) -> Any:
    try:
        return channel.try_recv()
    except zenoh.ZError:
        return None
