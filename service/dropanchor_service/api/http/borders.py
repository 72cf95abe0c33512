"""Keep web pages of other origins out. A browser on this machine, or in its network, sends what any page asks for.

Programs that are no browsers send neither `Origin` nor `Sec-Fetch-Site`, and pass. Other pages cannot read answers
anyway, so what only reads passes, too, except a WebSocket, which a browser lets any page open and read.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from dropanchor_schemas.sentences import say
from dropanchor_service.api.http.closing import reason_of
from dropanchor_service.api.http.errors import Kind, problem_response
from dropanchor_service.api.http.hosts import ALL, Hosts, name_in
from dropanchor_service.api.http.of_cluster import HOST, is_of_node
from dropanchor_service.api.http.permissions import SAFE_METHODS
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.security.own_hosts import own_hosts
from dropanchor_service.settings.http import HttpSettings

FORBIDDEN = 4403
"""The code with which the service ends a WebSocket."""
_MAX_NAME = 100
_NO_SUCH_PAGE = say(
    "other_origin", "A page of another origin may not connect: http.cors_origins in the settings can allow its origin."
)
_NO_SUCH_HOST = say(
    "no_such_host", "The service does not have this name: http.allowed_hosts in the settings can add it."
)


@dataclass(frozen=True)
class Border:
    """Who may pass. hosts: names of the service; None checks none. origins: of other pages that may use it, or `*`.

    own: names that proxies before the service have, of which pages are its own although the proxy sends another `Host`.
    """

    hosts: Hosts | None = None
    origins: Sequence[str] = ()
    own: Hosts | None = None


ANY_HOST = Border()


def border_of(http: HttpSettings, credentials: SecurityFolder | None) -> Border:
    """Return the border that the settings want."""
    return Border(Hosts(own_hosts(http, credentials)), http.cors_origins, Hosts(http.allowed_hosts))


class Borders:
    """ASGI middleware that refuses requests for another host, and what pages of other origins may not do."""

    def __init__(self, app: ASGIApp, border: Border) -> None:
        self._app = app
        self._border = border

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket") or is_of_node(scope):  # the node has checked its client
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        host = next((host for host in _hosts(headers) if not self._has(host)), None)
        if host is not None:
            await _refuse(scope, receive, send, Kind.OTHER_HOST, _no_such_host(host), _NO_SUCH_HOST)
        elif _matters(scope) and _is_foreign(headers, self._border):
            await _refuse(scope, receive, send, Kind.OTHER_ORIGIN, _no_such_page(headers), _NO_SUCH_PAGE)
        else:
            await self._app(scope, receive, send)

    def _has(self, host: str) -> bool:
        return self._border.hosts is None or self._border.hosts.allows(host)


def _hosts(headers: Headers) -> list[str]:
    """Return the host that a client named, and those that proxies say it named."""
    forwarded = [host.strip() for value in headers.getlist(HOST) for host in value.split(",")]
    return [*headers.getlist("host"), *forwarded]


def _matters(scope: Scope) -> bool:
    """Return whether a request may change or feed something, or opens a WebSocket."""
    return scope["type"] == "websocket" or scope["method"] not in SAFE_METHODS


def _is_foreign(headers: Headers, border: Border) -> bool:
    """Return whether a page sends this request that is neither of the service nor allowed."""
    origin, site = headers.get("origin"), headers.get("sec-fetch-site")
    if origin is None:
        return site in ("cross-site", "same-site")
    if site == "same-origin" or origin in border.origins or ALL in border.origins:
        return False
    netloc = _netloc(origin)
    return netloc not in _hosts(headers) and not (border.own is not None and border.own.has(netloc))


def _netloc(origin: str) -> str:
    """Return the host and port of an origin; empty when it has none, as `null`."""
    try:
        return urlsplit(origin).netloc
    except ValueError:  # such as http://[
        return ""


def _no_such_host(host: str) -> str:
    return say(
        "other_host",
        "The service does not have the name {name}, so a page of somebody else may have turned that name to it. If "
        "it is yours, add it to `allowed_hosts` in `[http]` of the settings. The address of the machine works, too.",
        name=repr((name_in(host) or host)[:_MAX_NAME]),
    )


def _no_such_page(headers: Headers) -> str:
    return say(
        "other_page",
        "A page of {origin} may not change or send anything here. To let it, add its origin to `cors_origins` in "
        "`[http]` of the settings; behind a proxy, let it pass the `Host` on.",
        origin=repr(headers.get("origin", "another origin")[:_MAX_NAME]),
    )


async def _refuse(scope: Scope, receive: Receive, send: Send, kind: Kind, detail: str, reason: str) -> None:
    """Answer with a problem. Accept a WebSocket first: a browser cannot read the answer to a handshake."""
    if scope["type"] == "http":
        await problem_response(Request(scope), kind, detail)(scope, receive, send)
        return
    await receive()
    offered = scope.get("subprotocols", [])
    await send({"type": "websocket.accept", "subprotocol": offered[0] if offered else None})
    await send({"type": "websocket.close", "code": FORBIDDEN, "reason": reason_of(reason, scope)})
