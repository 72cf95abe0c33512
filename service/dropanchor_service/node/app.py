"""The application of an API node: what it answers itself, and all else passed on to the owners of the sites."""

import re
import secrets
from collections.abc import Callable, Iterable
from contextlib import AbstractAsyncContextManager
from typing import Any

from fastapi import FastAPI
from prometheus_client import CollectorRegistry
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import RedirectResponse, Response
from starlette.routing import BaseRoute, Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from dropanchor_service.api.app import DASHBOARD, MAX_BODY_BYTES, PREFIX, WithoutSite
from dropanchor_service.api.http.access import Access
from dropanchor_service.api.http.borders import ANY_HOST, Border, Borders
from dropanchor_service.api.http.errors import ProblemError, add_error_handlers
from dropanchor_service.api.http.headers import SecurityHeaders, allow_origins
from dropanchor_service.api.http.limits import BodyLimit, EscapedPath
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.routes.dashboard import page_mounts
from dropanchor_service.api.routes.health import Impaired, Ready, health_router, metrics_router
from dropanchor_service.api.routes.parameters import json_response
from dropanchor_service.api.routes.plan_images import MAX_UPLOAD_BYTES
from dropanchor_service.node.owners import Owners
from dropanchor_service.security.identity import Authenticator

REQUEST_ID = "x-request-id"
TARGETS = "/metrics/targets"
_ID = re.compile(r"[A-Za-z0-9._:-]{1,64}")

Lifespan = Callable[[FastAPI], AbstractAsyncContextManager[None]]


def create_node_app(
    gateway: ASGIApp,
    owners: Owners,
    *,
    ready: Ready,
    impaired: Impaired,
    registry: CollectorRegistry,
    lifespan: Lifespan,
    authenticator: Authenticator | None = None,
    rate_limiter: RateLimiter | None = None,
    border: Border = ANY_HOST,
) -> FastAPI:
    """Return the application. The page, health and metrics are of the node itself; `gateway` has the rest.

    authenticator, rate_limiter: for the metrics; the owners check all else, but not the border. lifespan: what runs as
    long as it does.
    """
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None, redirect_slashes=False, lifespan=lifespan)
    app.add_middleware(BodyLimit, max_bytes=MAX_BODY_BYTES, of_paths={f"{PREFIX}/plan-images": MAX_UPLOAD_BYTES})
    app.add_middleware(Borders, border=border)
    app.add_middleware(EscapedPath)
    app.add_middleware(RequestId)
    app.add_middleware(SecurityHeaders)
    allow_origins(app, border.origins)
    add_error_handlers(app)
    page = page_mounts(DASHBOARD)
    of_metrics = _metrics_app(registry, owners, authenticator, rate_limiter)
    metrics = [Route(path, of_metrics, methods=["GET"]) for path in ("/metrics", TARGETS)]
    app.router.routes.extend([FrontPage(gateway, page[-1], owners), *page, *metrics])
    app.include_router(health_router(ready, impaired), prefix=PREFIX)
    app.router.default = gateway
    return app


def _metrics_app(
    registry: CollectorRegistry, owners: Owners, authenticator: Authenticator | None, rate_limiter: RateLimiter | None
) -> FastAPI:
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None)
    app.add_middleware(
        Access, authenticator=authenticator, rate_limiter=rate_limiter, members=lambda *_: [], only_site=None
    )
    app.include_router(metrics_router(registry))

    @app.get(TARGETS)
    async def get_targets() -> Response:
        return json_response(targets_of(owners.addresses))

    return app


def targets_of(addresses: Iterable[str]) -> list[dict[str, Any]]:
    """Return where Prometheus finds the metrics of owners, as its HTTP service discovery expects it."""
    divided = (address.partition("://") for address in sorted(addresses) if address)
    return [{"targets": [host.rstrip("/")], "labels": {"__scheme__": scheme}} for scheme, _, host in divided]


class FrontPage(WithoutSite):
    """The page without a site: of several buckets the overview, of an only one what its owner has there.

    While that owner is away, the page of this node says so.
    """

    def __init__(self, gateway: ASGIApp, page: BaseRoute, owners: Owners) -> None:
        super().__init__("/", self._serve, methods=["GET"])
        self.app = self._serve
        self._gateway = gateway
        self._page = page
        self._owners = owners

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        if len(self._owners.buckets) > 1:
            await RedirectResponse("sites/")(scope, receive, send)
            return
        try:
            await self._gateway(scope, receive, send)
        except ProblemError:
            await self._page.handle(scope, receive, send)


class RequestId:
    """ASGI middleware that gives a request an id, the client's or a new one, and its answer the same."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        given = Headers(scope=scope).get(REQUEST_ID, "")
        request_id = given if _ID.fullmatch(given) else secrets.token_hex(16)
        scope.setdefault("state", {})["request_id"] = request_id

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message)[REQUEST_ID] = request_id
            await send(message)

        await self._app(scope, receive, sending)
