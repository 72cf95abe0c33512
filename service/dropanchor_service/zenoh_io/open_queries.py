"""Read the replies to queries that are under way.

Each has a channel that holds all of its replies. An indirect callback would have one for 256 of them, and block Zenoh's
receive thread while it is full, so that the router drops live messages. A direct one would run on that thread, which
would have to wait for the interpreter lock.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import zenoh

from dropanchor_service.zenoh_io.channel import drain_now

REPLIES = 2**16  # that a channel holds; a full one would block, too


class _Query(NamedTuple):
    replies: Any
    on_reply: Callable[[Any], None]
    on_end: Callable[[], None]


class OpenQueries:
    """Queries of one thread, which calls `poll` now and then."""

    def __init__(self) -> None:
        self._queries: list[_Query] = []

    def __len__(self) -> int:
        return len(self._queries)

    def add(self, replies: Any, on_reply: Callable[[Any], None], on_end: Callable[[], None] = lambda: None) -> None:
        """Pass each reply of a FifoChannel to `on_reply`. Call `on_end` when the query has ended."""
        self._queries.append(_Query(replies, on_reply, on_end))

    def poll(self) -> None:
        """Pass on the replies that have come."""
        for query in list(self._queries):
            try:
                for reply in drain_now(query.replies):
                    query.on_reply(reply)
            except zenoh.ZError:
                self._queries.remove(query)
                query.on_end()
