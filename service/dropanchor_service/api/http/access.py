"""Authentication, authorization and rate limits, checked before a request reaches its route."""

import asyncio
import ipaddress
import math
from collections.abc import Mapping

from starlette.requests import HTTPConnection, Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from dropanchor_schemas.sentences import Sentence, said_by, say
from dropanchor_service.api.http.errors import Kind, problem_response
from dropanchor_service.api.http.permissions import INGEST, OF_ALL_SITES, Need, has_in, need_of
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.http.shared_view import Members, narrowed
from dropanchor_service.api.http.site_in_path import divided
from dropanchor_service.security import share_links
from dropanchor_service.security.identity import Authenticator, Identity, UnauthenticatedError
from dropanchor_service.store.trail import WHO, Who

KEY_IN_URL = (f"{INGEST}sensor-logger", f"{INGEST}phyphox")
"""Paths for apps of phones that cannot set headers."""
LOOPBACK = "loopback"
LOCAL = Who("local")
_LIMITED = say("link_limited", "This share link shows its tags and nothing else.")
_HOW_TO_AUTHENTICATE = say(
    "how_to_authenticate",
    "Send an API key or a token in the header `Authorization: Bearer …`. An operator creates a key with "
    "`dropanchor key add NAME --scope read`; for the samples of a tag, with `--tag TAG` instead of `--scope`.",
)


class Access:
    """ASGI middleware. Without an authenticator every client may do everything, and loopback has no rate limit.

    WebSockets pass: a browser can read why it is refused only after their handshake, so their route checks them.
    members: returns the tags of a group, to which a share link may be limited. only_site: its id; None: there are
    several.
    """

    def __init__(
        self,
        app: ASGIApp,
        authenticator: Authenticator | None,
        rate_limiter: RateLimiter | None,
        members: Members,
        only_site: str | None,
    ) -> None:
        self._app = app
        self._only_site = only_site
        self._members = members
        self._authenticator = authenticator
        self._rate_limiter = rate_limiter

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or need_of(scope["method"], scope["path"]) is Need.NOTHING:
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        identity, refusal = await self._authenticate(request)
        WHO.set(LOCAL if identity is None else Who(identity.source, identity.name))
        refusal = self._rate_limited(request, identity) or refusal or self._forbidden(request, identity)
        if refusal is not None:
            await refusal(scope, receive, send)
        elif identity is None:
            await self._app(scope, receive, send)
        else:
            site = self._site_of(request)
            scope.setdefault("state", {}).update(
                tag=identity.tag,
                site=identity.site,
                scope=identity.scope_in(site),
                scope_in=identity.scope_in,
                has=has_in(identity, site),
            )
            await self._app(scope, receive, self._while_valid(identity, send))

    async def _authenticate(self, request: Request) -> tuple[Identity | None, Response | None]:
        if self._authenticator is None:
            return None, None
        secret = secret_of(request)
        if not secret:
            return None, _unauthenticated(
                request, say("credentials_missing", "This request needs credentials. {how}", how=_HOW_TO_AUTHENTICATE)
            )
        try:
            return await identify(self._authenticator, secret), None
        except UnauthenticatedError as error:
            detail = say(
                "credentials_refused",
                "Authentication failed: {why}. {how}",
                why=said_by(error),
                how=_HOW_TO_AUTHENTICATE,
            )
            return None, _unauthenticated(request, detail)

    def _rate_limited(self, request: Request, identity: Identity | None) -> Response | None:
        client = client_of(request, identity)
        if self._rate_limiter is None or (self._authenticator is None and client == LOOPBACK):
            return None
        wait_s = self._rate_limiter.wait_s(client)
        if wait_s == 0:
            return None
        seconds = math.ceil(wait_s)
        detail = say(
            "wait",
            "Wait {seconds} s before the next request. /api/v1/poses and /api/v1/stream return all tags at once.",
            seconds=seconds,
        )
        return problem_response(request, Kind.TOO_MANY_REQUESTS, detail, headers={"retry-after": str(seconds)})

    def _forbidden(self, request: Request, identity: Identity | None) -> Response | None:
        refusal = _forbidden(request, identity, self._site_of(request), self._only_site is None)
        if refusal is not None or identity is None or identity.limit is None:
            return refusal
        if narrowed(request.scope, identity.limit, self._members):
            return None
        return problem_response(request, Kind.FORBIDDEN, _LIMITED)

    def _site_of(self, request: Request) -> str | None:
        """Return the site that a request concerns: the one in its path, or the only one; None for all sites."""
        return divided(request.scope["path"])[0] or self._only_site

    def _while_valid(self, identity: Identity, send: Send) -> Send:
        """Return a `send` that ends a stream when its key is revoked or its token expires."""
        assert self._authenticator is not None
        authenticator, chunks, ended = self._authenticator, 0, False

        async def sending(message: Message) -> None:
            nonlocal chunks, ended
            if ended:
                return  # the route learns from the server that its client is gone
            chunks += message["type"] == "http.response.body"
            if chunks > 1 and not authenticator.is_still_valid(identity):
                ended = True
                message = {"type": "http.response.body", "body": b"", "more_body": False}
            await send(message)

        return sending


async def identify(authenticator: Authenticator, secret: str) -> Identity:
    """Return the identity that the secret belongs to. Raises UnauthenticatedError."""
    provider = authenticator.provider_of(secret)
    if provider.may_block:
        return await asyncio.to_thread(provider.identify, secret)
    return provider.identify(secret)


def client_of(connection: HTTPConnection, identity: Identity | None) -> str:
    """Return what limits are counted by: the key or token, or without one the network address."""
    address = _network("" if connection.client is None else connection.client.host)
    if identity is None:
        return address
    name = f"{identity.source} {identity.name}"
    return f"{name} at {address}" if identity.source == share_links.SOURCE else name  # many people have one link


def bearer_of(connection: HTTPConnection) -> str:
    """Return the key or token in the header `Authorization`; empty without one."""
    scheme, _, secret = connection.headers.get("authorization", "").partition(" ")
    return secret.strip() if scheme.lower() == "bearer" else ""


def secret_of(request: Request) -> str:
    """Return the key or token of a request; empty without one. Apps of phones may put it into the URL."""
    in_url = request.query_params.get("token", "") if divided(request.scope["path"])[1] in KEY_IN_URL else ""
    return bearer_of(request) or in_url


def _forbidden(request: Request, identity: Identity | None, site: str | None, several_sites: bool) -> Response | None:
    """Return a refusal of what the client may not do in a site, or with None in all of them."""
    if identity is None:
        return None
    need, has = need_of(request.method, request.scope["path"]), has_in(identity, site)
    where = _where(site) if several_sites else ""
    if need is Need.TAG:
        allowed = speaks_in(identity, site, several_sites)
        needs = say("tag_key", "a key that was created with {command}", command=key_command(several_sites))
    elif request.scope["path"] in OF_ALL_SITES and identity.of_sites and identity.limit is None:
        return None  # it learns of its sites alone
    else:
        allowed, needs = has >= need, _scope(max(need, Need.READ), where)
    if allowed:
        return None
    return problem_response(request, Kind.FORBIDDEN, _refusal(identity, has, where, needs))


def _refusal(identity: Identity, has: Need, where: str, needs: str) -> str:
    if has is Need.LINK_TO_TAGS:
        return _LIMITED
    if has is Need.LINK:
        return say("link_shows", "A share link shows the page and no more; this request needs {needs}.", needs=needs)
    held = _scope(has, where) if has else say("no_scope", "no scope{where}", where=where)
    return say(
        "scope_missing",
        "The {source} of {name} has {has}; this request needs {needs}.",
        source=identity.source,
        name=repr(identity.name),
        has=held,
        needs=needs,
    )


def _scope(scope: Need, where: str) -> Sentence:
    return say("scope", "the scope {scope}{where}", scope=scope.name.lower(), where=where)


def _where(site: str | None) -> str:
    if site is None:
        return say("in_every_site", " in every site")
    return say("in_site", " in site {site}", site=repr(site))


def speaks_in(identity: Identity, site: str | None, several_sites: bool) -> bool:
    """Return whether a client may send samples of its tag to a site; None: that of its key."""
    if identity.tag is None:
        return False
    if several_sites:
        return identity.site is not None and site in (None, identity.site)
    return identity.site in (None, site)


def key_command(several_sites: bool) -> str:
    """Return the command that creates a key for a tag."""
    return "dropanchor key add NAME --tag TAG" + (" --site SITE" if several_sites else "")


def _unauthenticated(request: Request, detail: str) -> Response:
    headers: Mapping[str, str] = {"www-authenticate": 'Bearer realm="dropanchor"'}
    return problem_response(request, Kind.UNAUTHENTICATED, detail, headers=headers)


def _network(address: str) -> str:
    """Return what identifies a client without credentials: its IPv4 address, or its IPv6 /64 network."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    if parsed.is_loopback:
        return LOOPBACK
    return str(ipaddress.ip_network((parsed, 64), strict=False)) if parsed.version == 6 else address
