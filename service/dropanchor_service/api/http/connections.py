"""How many WebSockets each client may have."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager


class TooManyConnectionsError(Exception):
    """A client has as many connections as allowed."""


class OpenConnections:
    """Open connections of each client."""

    def __init__(self) -> None:
        self._open: Counter[str] = Counter()

    @contextmanager
    def one_more(self, client: str, limit: int) -> Iterator[None]:
        """Count a connection until the block ends. limit: of each client. Raises TooManyConnectionsError."""
        if self._open[client] >= limit:
            raise TooManyConnectionsError
        self._open[client] += 1
        try:
            yield
        finally:
            self._open[client] -= 1
            if not self._open[client]:
                del self._open[client]
