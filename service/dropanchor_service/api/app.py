"""Build the FastAPI application. Everything it uses is passed in."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from fastapi import FastAPI, Request
from prometheus_client import CollectorRegistry
from starlette.responses import RedirectResponse
from starlette.routing import BaseRoute, Match, Route
from starlette.types import Scope

from dropanchor_service.api.document import openapi_of
from dropanchor_service.api.http.access import Access
from dropanchor_service.api.http.borders import Borders
from dropanchor_service.api.http.errors import Kind, ProblemError, add_error_handlers
from dropanchor_service.api.http.headers import SecurityHeaders, allow_origins
from dropanchor_service.api.http.limits import BodyLimit, EscapedPath
from dropanchor_service.api.omlox.router import omlox_routes
from dropanchor_service.api.routes.below import below
from dropanchor_service.api.routes.dashboard import page_mounts
from dropanchor_service.api.routes.health import Impaired, Ready, health_router, metrics_router
from dropanchor_service.api.routes.plan_images import MAX_UPLOAD_BYTES
from dropanchor_service.api.routes.shared_parts import SharedParts
from dropanchor_service.api.routes.site_of_request import SitesOfApp
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.api.routes.sites import routes_of_sites
from dropanchor_service.api.site_routers import INGEST, SITE

PREFIX = "/api/v1"
ALL_METHODS = ["DELETE", "GET", "HEAD", "PATCH", "POST", "PUT"]
MAX_BODY_BYTES = 1_048_576
DASHBOARD = Path(__file__).parent.parent / "dashboard"


def create_app(
    sites: Sequence[SiteParts],
    shared: SharedParts,
    *,
    ready: Ready,
    impaired: Impaired,
    registry: CollectorRegistry,
    dashboard: Path | None = DASHBOARD,
) -> FastAPI:
    """Return the application of one or several sites. Each has its routes below its id.

    An only site has them also without. With several, the page shows the site in its address, `/?site=…`, and without
    one the overview of the sites takes its place. ready: returns whether the service can do its work, and the reasons
    when it cannot. impaired: returns what else does not work. dashboard: the folder of the page; None for no page.
    """
    served = SitesOfApp(sites)
    app = _app_without_routes(shared, served)
    if dashboard is not None:  # before the interfaces: a page needs many files at once
        app.router.routes.extend([*([] if served.only else [_overview_first()]), *page_mounts(dashboard)])
    has_one_site = served.only is not None
    app.router.routes.extend(_routes(has_one_site))
    app.router.routes.extend(below(PREFIX, health_router(ready, impaired).routes))
    app.router.routes.extend(metrics_router(registry).routes)
    if all(one.omlox is not None for one in sites):
        app.router.routes.extend(omlox_routes(has_one_site))
    if not has_one_site:
        _refuse_what_names_no_site(app, len(sites))
    app.openapi = lambda: openapi_of(app)  # type: ignore[method-assign]
    return app


@cache
def _routes(has_one_site: bool) -> tuple[BaseRoute, ...]:
    """Return the routes of the sites. They hold nothing of an application, so all those of a process share them."""
    without_site = SITE if has_one_site else INGEST
    own = [route for router in without_site for route in router.routes]
    return tuple(below(PREFIX, [*own, *routes_of_sites(SITE)]))


def _refuse_what_names_no_site(app: FastAPI, sites: int) -> None:
    @app.api_route("/{path:path}", methods=ALL_METHODS, include_in_schema=False)
    async def refuse(request: Request) -> None:
        raise ProblemError(
            Kind.SEVERAL_SITES,
            f"{request.url.path} names none of the {sites} sites of this service. /api/v1/sites lists them, and "
            "/api/v1/sites/SITE has what each of them has.",
        )


class WithoutSite(Route):
    """The page without a site in its address."""

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        match, child_scope = super().matches(scope)
        names_site = match is not Match.NONE and "site" in Request(scope).query_params
        return (Match.NONE, {}) if names_site else (match, child_scope)


def _overview_first() -> Route:
    """Return what leads from the page without a site to the overview."""
    return WithoutSite("/", lambda _: RedirectResponse("sites/"), methods=["GET"])


def _app_without_routes(shared: SharedParts, sites: SitesOfApp) -> FastAPI:
    """Return an application with the middleware alone."""
    app = FastAPI(
        title="Dropanchor",
        version="1",
        openapi_url=f"{PREFIX}/openapi.json",
        docs_url=None,  # its scripts come from a CDN; `page_mounts` has them without internet access
        redoc_url=None,
        redirect_slashes=False,
    )
    app.add_middleware(BodyLimit, max_bytes=MAX_BODY_BYTES, of_paths={f"{PREFIX}/plan-images": MAX_UPLOAD_BYTES})
    app.state.sites, app.state.shared = sites, shared
    only_site = None if sites.only is None else sites.only.id
    app.add_middleware(
        Access,
        authenticator=shared.authenticator,
        rate_limiter=shared.rate_limiter,
        members=sites.members,
        only_site=only_site,
    )
    app.add_middleware(Borders, border=shared.border)
    app.add_middleware(EscapedPath)
    app.add_middleware(SecurityHeaders)
    allow_origins(app, shared.border.origins)
    add_error_handlers(app)
    return app
