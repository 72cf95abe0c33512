"""The application until the service is ready: the page, and answers that say what the service still does."""

from collections.abc import Callable
from pathlib import Path

from fastapi import FastAPI
from starlette.types import ASGIApp, Receive, Scope, Send

from dropanchor_service.api.app import ALL_METHODS, DASHBOARD, PREFIX
from dropanchor_service.api.http.errors import Kind, ProblemError, add_error_handlers
from dropanchor_service.api.http.headers import SecurityHeaders
from dropanchor_service.api.http.limits import EscapedPath
from dropanchor_service.api.http.site_in_path import OMLOX_PREFIX
from dropanchor_service.api.routes.dashboard import page_mounts
from dropanchor_service.api.routes.health import health_router


class CurrentApp:
    """An ASGI application that passes every request to another one, which may be replaced."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await self.app(scope, receive, send)


def create_starting_app(reason: Callable[[], str], dashboard: Path = DASHBOARD) -> FastAPI:
    """Return the application. It holds no data of the site, so it needs no credentials. reason: what is still done."""
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None, redirect_slashes=False)
    app.add_middleware(EscapedPath)
    app.add_middleware(SecurityHeaders)
    add_error_handlers(app)
    app.include_router(health_router(lambda: (False, [reason()]), list), prefix=PREFIX)

    @app.api_route("/metrics", methods=ALL_METHODS)
    @app.api_route("/api/{path:path}", methods=ALL_METHODS)
    @app.api_route(f"{OMLOX_PREFIX}{{path:path}}", methods=ALL_METHODS)
    @app.api_route(f"/sites/{{site}}{OMLOX_PREFIX}{{path:path}}", methods=ALL_METHODS)
    async def refuse() -> None:
        raise ProblemError(Kind.NOT_READY, reason())

    app.router.routes.extend(page_mounts(dashboard))
    return app
