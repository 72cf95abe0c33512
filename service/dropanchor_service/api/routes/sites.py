"""The sites that the service serves, and the routes that each of them has."""

from collections.abc import Callable, Iterator
from typing import Any

from fastapi import APIRouter
from fastapi.routing import APIRoute
from starlette.responses import Response

from dropanchor_schemas.answers import SiteList
from dropanchor_service.answers.answers import Answer
from dropanchor_service.answers.of_sites import AnswersOfSites
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response
from dropanchor_service.api.routes.poses import poses_router
from dropanchor_service.api.routes.site import site_router
from dropanchor_service.api.routes.site_of_request import SITE_IN_PATH, SITE_PREFIX, SiteOfRequest
from dropanchor_service.api.routes.tags import tag_router, tags_router

MaxTags = Callable[[str], int]
"""Returns how many tags a site admits."""


def sites_router(sites: AnswersOfSites, max_tags: MaxTags) -> APIRouter:
    """Return the list of the sites, and for each site the routes of `site_routers` below its id."""
    router = APIRouter()
    _add_list_route(router, sites)
    for routes in site_routers(SiteOfRequest(sites), max_tags):
        for route in _api_routes(routes):
            route.operation_id = route.unique_id = f"{route.operation_id}_of_site"
            route.responses = _with_unknown_site(route.responses)
        router.include_router(routes, prefix=SITE_PREFIX, dependencies=[SITE_IN_PATH])
    return router


def site_routers(site_of: SiteOfRequest, max_tags: MaxTags) -> tuple[APIRouter, ...]:
    """Return the routes about the poses, tags and anchors of the site that `site_of` finds."""
    return poses_router(site_of), tags_router(site_of), tag_router(site_of, max_tags), site_router(site_of)


def _with_unknown_site(responses: dict[int | str, dict[str, Any]]) -> dict[int | str, dict[str, Any]]:
    unknown = problems(Kind.UNKNOWN_SITE)[404]
    others = responses.get(404, {}).get("description", "")
    return responses | {404: unknown | {"description": f"{unknown['description']} {others}".rstrip()}}


def _api_routes(router: APIRouter) -> Iterator[APIRoute]:
    return (route for route in router.routes if isinstance(route, APIRoute))


def _add_list_route(router: APIRouter, sites: AnswersOfSites) -> None:
    @router.get(
        "/sites",
        operation_id="list_sites",
        summary="List the sites of the service",
        tags=["site"],
        response_model=SiteList,
        responses=example_response(examples.SITE_LIST) | problems(Kind.INVALID_REQUEST),
        dependencies=[NO_QUERY],
    )
    def list_sites() -> Response:
        return json_response({"sites": list(_summaries(sites))})


def _summaries(sites: AnswersOfSites) -> Iterator[Answer]:
    """Yield the `SiteSummary` of each site."""
    for answers in sites:
        site = answers.site.site
        yield {
            "site": site.id,
            "name": site.name,
            "georeference": None if site.georeference is None else site.georeference.model_dump(),
            "anchors": len(site.anchors),
            "tags": len(answers.tags.listed()),
            "online": answers.tags.presence.count(),
        }
