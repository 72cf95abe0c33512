"""What a node has of a request: all of it that can be sent to an owner, once or again."""

from collections.abc import AsyncIterator
from dataclasses import dataclass

from starlette.requests import HTTPConnection
from starlette.types import Message, Receive, Scope

from dropanchor_service.api.http.behind_proxy import PREFIX, prefix_of
from dropanchor_service.api.http.of_cluster import CLIENT, HOST, OF_NODES, SCHEME, SECRET

KEPT_BYTES = 1_048_576
"""A longer body passes through as it comes, and is not sent again."""
SAFE = ("GET", "HEAD", "OPTIONS")
_HOP_BY_HOP = frozenset(
    {
        *("connection", "keep-alive", "proxy-authenticate", "proxy-authorization", "proxy-connection", "te"),
        *("trailer", "transfer-encoding", "upgrade", "expect"),
    }
)
"""Headers of one connection (RFC 9110, section 7.6.1), and one that the server of this node has answered."""
_OWN_TO_A_SERVER = frozenset({"date", "server"})
_ORIGIN = frozenset({"origin"})
RawHeaders = list[tuple[bytes, bytes]]


class ClientGoneError(Exception):
    """The client has disconnected."""


class Body:
    """The body of a request: its begin, and what is still to come of a long one."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._begin = b""
        self._begun = False
        self.is_whole = False

    async def begin(self) -> None:
        """Receive the body, or as much of it as is kept. Raises ClientGoneError."""
        chunks, size = [], 0
        while not self.is_whole and size <= KEPT_BYTES:
            chunks.append(await self._next())
            size += len(chunks[-1])
        self._begin = b"".join(chunks)

    @property
    def can_repeat(self) -> bool:
        return self.is_whole or not self._begun

    def content(self) -> bytes | AsyncIterator[bytes]:
        """Return the body to send it. Only a whole one can be sent again."""
        return self._begin if self.is_whole else self._rest()

    async def _rest(self) -> AsyncIterator[bytes]:
        self._begun = True
        yield self._begin
        while not self.is_whole:
            yield await self._next()

    async def _next(self) -> bytes:
        message: Message = await self._receive()
        if message["type"] == "http.disconnect":
            raise ClientGoneError
        self.is_whole = not message.get("more_body", False)
        body: bytes = message.get("body", b"")
        return body


@dataclass(frozen=True)
class Asked:
    """A request. target: its path and query as the client sent them. headers: for the owner."""

    method: str
    target: bytes
    headers: RawHeaders
    body: Body
    request_id: str

    @property
    def is_safe(self) -> bool:
        """Whether it changes nothing, so that it may be sent twice."""
        return self.method in SAFE


def target_of(scope: Scope) -> bytes:
    raw: bytes = scope["raw_path"]
    query: bytes = scope["query_string"]
    return raw + b"?" + query if query else raw


def headers_for_owner(scope: Scope, secret: bytes, request_id: str) -> RawHeaders:
    """Return the headers of a request of a client, and what the owner has to know about the client.

    The node itself answers what browsers ask before they let other pages read, so the owner gets no `Origin` over HTTP.
    """
    is_socket = scope["type"] == "websocket"
    dropped = {*_HOP_BY_HOP, *OF_NODES, "host", "x-request-id", *([] if is_socket else _ORIGIN)}
    named = _named_by_connection(scope["headers"])
    headers = [(name, value) for name, value in scope["headers"] if name.decode("latin-1") not in dropped | named]
    host = next((value for name, value in scope["headers"] if name == b"host"), b"")
    client = scope["client"][0] if scope.get("client") else ""
    scheme = "https" if scope["scheme"] in ("https", "wss") else "http"
    about = {SECRET: secret, CLIENT: client.encode(), HOST: host, SCHEME: scheme.encode()}
    about |= {PREFIX: prefix.encode()} if (prefix := prefix_of(HTTPConnection(scope))) else {}
    headers += [(name.encode(), value) for name, value in about.items()]
    return [*headers, (b"x-request-id", request_id.encode())]


def headers_for_client(headers: RawHeaders, internal: frozenset[str]) -> RawHeaders:
    """Return the headers of an owner's answer for the client. internal: names of those between owner and node."""
    dropped = _HOP_BY_HOP | _OWN_TO_A_SERVER | internal
    return [(name.lower(), value) for name, value in headers if name.decode("latin-1").lower() not in dropped]


def _named_by_connection(headers: RawHeaders) -> set[str]:
    values = [value.decode("latin-1") for name, value in headers if name == b"connection"]
    return {name.strip().lower() for value in values for name in value.split(",")}
