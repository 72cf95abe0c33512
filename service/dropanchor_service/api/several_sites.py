"""Build the application of a service with several sites, which has fewer routes so far."""

from collections.abc import Sequence
from pathlib import Path

from fastapi import FastAPI, Request
from prometheus_client import CollectorRegistry
from starlette.responses import RedirectResponse
from starlette.routing import Match, Route
from starlette.types import Scope

from dropanchor_service.api.app import ALL_METHODS, DASHBOARD, PREFIX, app_without_routes, openapi_of
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.routes.dashboard import page_mounts
from dropanchor_service.api.routes.health import Impaired, Ready, health_router, metrics_router
from dropanchor_service.api.routes.site_of_request import SiteOfRequest
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.api.routes.sites import sites_router
from dropanchor_service.api.site_routers import SharedParts, ingest_routers, site_routers


class OverviewFirst(Route):
    """Leads from the page without a site to the overview."""

    def __init__(self) -> None:
        super().__init__("/", lambda _: RedirectResponse("sites/"), methods=["GET"])

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        match, child_scope = super().matches(scope)
        names_site = match is not Match.NONE and "site" in Request(scope).query_params
        return (Match.NONE, {}) if names_site else (match, child_scope)


def create_app_of_sites(
    sites: Sequence[SiteParts],
    shared: SharedParts,
    *,
    ready: Ready,
    impaired: Impaired,
    registry: CollectorRegistry,
    dashboard: Path | None = DASHBOARD,
) -> FastAPI:
    """Return the application; see `create_app`. Each site has its routes below its id.

    The page shows the site in its address, `/?site=…`. Without one, the overview of the sites takes its place.
    """
    site_of = SiteOfRequest(sites)
    app = app_without_routes(shared, site_of, lambda _: [])
    if dashboard is not None:
        app.router.routes.extend([OverviewFirst(), *page_mounts(dashboard)])
    app.include_router(sites_router(site_of, site_routers(site_of, shared)), prefix=PREFIX)
    for router in ingest_routers(site_of, shared):
        app.include_router(router, prefix=PREFIX)
    app.include_router(health_router(ready, impaired), prefix=PREFIX)
    app.include_router(metrics_router(registry))

    @app.api_route("/{path:path}", methods=ALL_METHODS, include_in_schema=False)
    async def refuse(request: Request) -> None:
        raise ProblemError(
            Kind.SEVERAL_SITES,
            f"{request.url.path} is for one site so far, and this service has {len(sites)}. /api/v1/sites lists them, "
            "and /api/v1/sites/SITE has what each of them has.",
        )

    app.openapi = lambda: openapi_of(app)  # type: ignore[method-assign]
    return app
