"""The application until the service is ready: the page, and answers that say what the service still does."""

from collections.abc import Callable

from fastapi import FastAPI
from prometheus_client.registry import Collector, CollectorRegistry
from starlette.types import ASGIApp, Receive, Scope, Send

from dropanchor_service.api.app import ALL_METHODS, DASHBOARD, PREFIX
from dropanchor_service.api.http.borders import ANY_HOST, Border, Borders
from dropanchor_service.api.http.errors import Kind, ProblemError, add_error_handlers
from dropanchor_service.api.http.headers import SecurityHeaders
from dropanchor_service.api.http.limits import EscapedPath
from dropanchor_service.api.http.site_in_path import OMLOX_PREFIX
from dropanchor_service.api.routes.dashboard import page_mounts
from dropanchor_service.api.routes.health import health_router, metrics_router


class CurrentApp:
    """An ASGI application that passes every request to another one, which may be replaced."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await self.app(scope, receive, send)


class Gate:
    """An ASGI application that passes requests to one of two others. is_open: asked for each request."""

    def __init__(self, is_open: Callable[[], bool], app: ASGIApp, otherwise: ASGIApp) -> None:
        self._is_open = is_open
        self._app = app
        self._otherwise = otherwise

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await (self._app if self._is_open() else self._otherwise)(scope, receive, send)


def create_starting_app(
    reason: Callable[[], str],
    gauges: Collector | None = None,
    border: Border = ANY_HOST,
) -> FastAPI:
    """Return the application. It holds no data of the site, so it needs no credentials.

    reason: why the service does not serve yet. gauges: metrics that it has all the same. border: as of the full one.
    """
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None, redirect_slashes=False)
    app.add_middleware(Borders, border=border)
    app.add_middleware(EscapedPath)
    app.add_middleware(SecurityHeaders)
    add_error_handlers(app)
    app.include_router(health_router(lambda: (False, [reason()]), list), prefix=PREFIX)

    if gauges is not None:
        registry = CollectorRegistry()
        registry.register(gauges)
        app.include_router(metrics_router(registry))

    @app.api_route("/metrics", methods=ALL_METHODS)
    @app.api_route("/api/{path:path}", methods=ALL_METHODS)
    @app.api_route(f"{OMLOX_PREFIX}{{path:path}}", methods=ALL_METHODS)
    @app.api_route(f"/sites/{{site}}{OMLOX_PREFIX}{{path:path}}", methods=ALL_METHODS)
    async def refuse() -> None:
        raise ProblemError(Kind.NOT_READY, reason())

    app.router.routes.extend(page_mounts(DASHBOARD))
    return app
