"""What a reverse proxy says of a request: the client, the scheme, and the path below which it has the service."""

import re
from collections.abc import Sequence

from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

PREFIX = "x-forwarded-prefix"
"""Header with the path of the service at the proxy, such as `/rtls`."""
ON_THIS_MACHINE = ("127.0.0.1", "::1")
_IS_PREFIX = re.compile(r"(/[A-Za-z0-9._~-]{1,64}){1,8}")
_STATE = "prefix"


class BehindProxy:
    """ASGI middleware that believes proxies at these addresses and networks, and nobody else."""

    def __init__(self, app: ASGIApp, trusted: Sequence[str]) -> None:
        self._app = ProxyHeadersMiddleware(app, list(trusted))  # type: ignore[arg-type]  # it has types of its own

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] in ("http", "websocket") and (scope.get("client") or [""])[0] in self._app.trusted_hosts:
            scope = with_prefix(scope, Headers(scope=scope).get(PREFIX, ""))
        await self._app(scope, receive, send)  # type: ignore[arg-type]


def with_prefix(scope: Scope, prefix: str) -> Scope:
    """Return the scope of a request that came below this path. What cannot be one is left out."""
    path = prefix.rstrip("/")
    return {**scope, "state": {**scope.get("state", {}), _STATE: path}} if _IS_PREFIX.fullmatch(path) else scope


def prefix_of(connection: HTTPConnection) -> str:
    """Return the path that comes before those of the service in an address, such as `/rtls`; empty without a proxy."""
    prefix: str = connection.scope.get("state", {}).get(_STATE, "")
    return prefix
