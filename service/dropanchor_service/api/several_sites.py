"""Build the application of a service with several sites, which has fewer routes so far."""

from collections.abc import Callable

from fastapi import FastAPI, Request
from prometheus_client import CollectorRegistry

from dropanchor_service.answers.of_sites import AnswersOfSites
from dropanchor_service.api.app import ALL_METHODS, PREFIX, app_without_routes
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.routes.health import Impaired, Ready, health_router, metrics_router
from dropanchor_service.api.routes.sites import sites_router
from dropanchor_service.settings.model import HttpSettings


def create_app_of_sites(
    sites: AnswersOfSites,
    *,
    ready: Ready,
    impaired: Impaired,
    registry: CollectorRegistry,
    max_tags: Callable[[str], int],
    settings: HttpSettings,
) -> FastAPI:
    """Return the application; see `create_app`. max_tags: returns how many tags a site admits."""
    limiter = RateLimiter(settings.requests_per_s, settings.burst)
    app = app_without_routes(None, limiter, settings.cors_origins, lambda _: [])
    app.include_router(sites_router(sites, max_tags), prefix=PREFIX)
    app.include_router(health_router(ready, impaired), prefix=PREFIX)
    app.include_router(metrics_router(registry))

    @app.api_route("/{path:path}", methods=ALL_METHODS, include_in_schema=False)
    async def refuse(request: Request) -> None:
        raise ProblemError(
            Kind.SEVERAL_SITES,
            f"{request.url.path} is for one site so far, and this service has {len(sites)}. /api/v1/sites lists them, "
            "and /api/v1/sites/SITE has the poses, tags and anchors of each.",
        )

    return app
