"""Limits for WebSockets: how many each client may have, and which pages of a browser may open them."""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from urllib.parse import urlsplit

from starlette.requests import HTTPConnection


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


def is_of_another_page(connection: HTTPConnection, allowed: Sequence[str] = ()) -> bool:
    """Return whether a page of another origin than the service opens this connection. allowed: other origins."""
    origin = connection.headers.get("origin")
    return (
        origin is not None
        and origin not in allowed
        and "*" not in allowed
        and urlsplit(origin).netloc != connection.headers.get("host")
    )
