"""Who may ask what: before a request reaches its route, somebody has to be known, be allowed, and not ask too often."""

import asyncio
import ipaddress
import math
from collections.abc import Mapping

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from dropanchor_service.api.http.errors import Kind, problem_response
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.security.identity import Authenticator, Identity, UnauthenticatedError
from dropanchor_service.security.identity import Scope as Rank

OPEN = ("/api/v1/health/live", "/api/v1/health/ready", "/api/v1/openapi.json")
_SITE = "/api/v1/site"
_HOW = (
    "Send an API key or a token: `Authorization: Bearer …`. An operator makes a key with "
    "`dropanchor key add NAME --scope read`."
)


class Access:
    """ASGI. Without a doorkeeper everybody may do everything; the loopback is then not held back either."""

    def __init__(self, app: ASGIApp, authenticator: Authenticator | None, rate_limiter: RateLimiter | None) -> None:
        self._app = app
        self._authenticator = authenticator
        self._rate_limiter = rate_limiter

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or not _is_guarded(scope["path"]):
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        identity, refusal = await self._identified(request)
        refusal = self._held_back(request, identity) or refusal or _forbidden(request, identity)
        if refusal is not None:
            await refusal(scope, receive, send)
        elif identity is None:
            await self._app(scope, receive, send)
        else:
            await self._app(scope, receive, self._while_good(identity, send))

    async def _identified(self, request: Request) -> tuple[Identity | None, Response | None]:
        if self._authenticator is None:
            return None, None
        scheme, _, secret = Headers(scope=request.scope).get("authorization", "").partition(" ")
        if scheme.lower() != "bearer" or not secret.strip():
            return None, _unauthenticated(request, f"This service wants to know who asks. {_HOW}")
        try:
            register, secret = self._authenticator.provider_of(secret.strip()), secret.strip()
            if register.takes_time:
                return await asyncio.to_thread(register.identify, secret), None
            return register.identify(secret), None
        except UnauthenticatedError as error:
            return None, _unauthenticated(request, f"Refused: {error}. {_HOW}")

    def _held_back(self, request: Request, identity: Identity | None) -> Response | None:
        address = "" if request.client is None else request.client.host
        client = _network(address) if identity is None else f"{identity.source} {identity.name}"
        if self._rate_limiter is None or (self._authenticator is None and client == "loopback"):
            return None
        wait_s = self._rate_limiter.wait_s(client)
        if wait_s == 0:
            return None
        seconds = math.ceil(wait_s)
        detail = f"Too many requests: wait {seconds} s. /api/v1/poses and /api/v1/stream give all tags at once."
        return problem_response(request, Kind.TOO_MANY_REQUESTS, detail, headers={"retry-after": str(seconds)})

    def _while_good(self, identity: Identity, send: Send) -> Send:
        """A stream ends when its key is revoked or its token expires."""
        assert self._authenticator is not None
        authenticator, pieces, ended = self._authenticator, 0, False

        async def sending(message: Message) -> None:
            nonlocal pieces, ended
            if ended:
                return  # the server tells the route that its client is gone
            pieces += message["type"] == "http.response.body"
            if pieces > 1 and not authenticator.is_still_good(identity):
                ended = True
                message = {"type": "http.response.body", "body": b"", "more_body": False}
            await send(message)

        return sending


def _is_guarded(path: str) -> bool:
    """The page itself says nothing; what it shows comes from the interface."""
    return (path.startswith("/api/") or path == "/metrics") and path not in OPEN


def needed(method: str, path: str) -> Rank:
    """Reading is READ; the site itself and whatever is deleted is ADMIN; other changes are WRITE."""
    if method in ("GET", "HEAD", "OPTIONS"):
        return Rank.READ
    return Rank.ADMIN if method == "DELETE" or path == _SITE else Rank.WRITE


def _forbidden(request: Request, identity: Identity | None) -> Response | None:
    rank = needed(request.method, request.scope["path"])
    if identity is None or (identity.scope is not None and identity.scope >= rank):
        return None
    has = "no scope" if identity.scope is None else f"the scope {identity.scope.word}"
    detail = f"The {identity.source} of {identity.name!r} has {has}; this needs {rank.word}."
    return problem_response(request, Kind.FORBIDDEN, detail)


def _unauthenticated(request: Request, detail: str) -> Response:
    headers: Mapping[str, str] = {"www-authenticate": 'Bearer realm="dropanchor"'}
    return problem_response(request, Kind.UNAUTHENTICATED, detail, headers=headers)


def _network(address: str) -> str:
    """One client's: an address of IPv4, 64 bits of IPv6."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    if parsed.is_loopback:
        return "loopback"
    return str(ipaddress.ip_network((parsed, 64), strict=False)) if parsed.version == 6 else address
