"""What a service and the API nodes before it tell each other: who owns the sites, and who the client is."""

import hmac
from collections.abc import Mapping
from urllib.parse import quote

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from dropanchor_service.api.http.behind_proxy import PREFIX, with_prefix
from dropanchor_service.api.http.errors import Kind, problem_response

BUCKET, EPOCH = "dropanchor-bucket", "dropanchor-epoch"
"""Headers of every answer of an owner."""
SECRET, CLIENT, HOST, SCHEME = "dropanchor-node", "x-forwarded-for", "x-forwarded-host", "x-forwarded-proto"
"""Headers of every request of a node: its secret, and what it says about the client."""
OF_NODES = frozenset({SECRET, CLIENT, HOST, SCHEME, PREFIX})
_NODE = "dropanchor_node"
_SECURE = {"http": "https", "ws": "wss"}


class NamesOwner:
    """ASGI middleware that says in every answer whose it is, so that a node drops those of former owners."""

    def __init__(self, app: ASGIApp, bucket: str, epoch: int) -> None:
        self._app = app
        self._headers = owner_headers(bucket, epoch)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def sending(message: Message) -> None:
            if message["type"] in ("http.response.start", "websocket.accept"):
                MutableHeaders(scope=message).update(self._headers)
            await send(message)

        await self._app(scope, receive, sending)


def owner_headers(bucket: str, epoch: int) -> dict[str, str]:
    return {BUCKET: quote(bucket, safe=""), EPOCH: str(epoch)}


def epoch_in(headers: Mapping[str, str], bucket: str) -> int | None:
    """Return the epoch of the owner that answers; None if it is no owner of this bucket."""
    epoch = headers.get(EPOCH, "")
    return int(epoch) if headers.get(BUCKET) == quote(bucket, safe="") and epoch.isdecimal() else None


class FromNodes:
    """ASGI middleware that believes what a node with the secret says about its client. secret: None if there is none.

    Nobody else is believed, and a wrong secret is refused, since without it all clients would share one rate limit.
    """

    def __init__(self, app: ASGIApp, secret: bytes | None) -> None:
        self._app = app
        self._secret = secret

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        shown = headers.get(SECRET)
        if shown is None:
            await self._app(scope, receive, send)
        elif self._secret is not None and hmac.compare_digest(shown.encode("latin-1"), self._secret):
            await self._app(_of_client(scope, headers), receive, send)
        elif scope["type"] == "http":
            await problem_response(Request(scope), Kind.FORBIDDEN, self._refusal())(scope, receive, send)
        else:
            await send({"type": "websocket.close", "code": 1008, "reason": self._refusal()})

    def _refusal(self) -> str:
        if self._secret is None:
            return "This service believes no API node: set cluster.node_secret to the file that the nodes have."
        return "The secret of the API node is not that of this service: give both the same cluster.node_secret."


def is_of_node(scope: Scope) -> bool:
    """Return whether a node with the secret has sent a request."""
    return bool(scope.get("state", {}).get(_NODE))


def _of_client(scope: Scope, headers: Headers) -> Scope:
    """Return the scope as if the client had sent the request itself."""
    kept = [(name, value) for name, value in scope["headers"] if name.decode("latin-1") not in {*OF_NODES, "host"}]
    if HOST in headers:
        kept.append((b"host", headers[HOST].encode("latin-1")))
    scheme = "ws" if scope["type"] == "websocket" else "http"
    if headers.get(SCHEME) == "https":
        scheme = _SECURE[scheme]
    state = {**scope.get("state", {}), _NODE: True}
    scope = {**scope, "headers": kept, "client": (headers.get(CLIENT, ""), 0), "scheme": scheme, "state": state}
    return with_prefix(scope, headers.get(PREFIX, ""))
