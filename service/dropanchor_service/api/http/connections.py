"""How many WebSockets each client may have."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager


class TooManyConnectionsError(Exception):
    """A client has as many connections as allowed."""


class OpenConnections:
    """Open connections of each client."""

    def __init__(self, limit: int) -> None:
        """limit: of each client."""
        self._limit = limit
        self._open: Counter[str] = Counter()

    @contextmanager
    def one_more(self, client: str) -> Iterator[None]:
        """Count a connection until the block ends. Raises TooManyConnectionsError."""
        if self._open[client] >= self._limit:
            raise TooManyConnectionsError
        self._open[client] += 1
        try:
            yield
        finally:
            self._open[client] -= 1
            if not self._open[client]:
                del self._open[client]
