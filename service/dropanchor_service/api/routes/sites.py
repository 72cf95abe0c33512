"""The sites that the service serves, and the routes that each of them has."""

from collections.abc import Iterable, Iterator
from typing import Any

from fastapi import APIRouter, Request
from fastapi.routing import APIRoute
from starlette.responses import Response

from dropanchor_schemas.answers import SiteList
from dropanchor_service.answers.site_summaries import summaries
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response
from dropanchor_service.api.routes.site_of_request import SITE_IN_PATH, SITE_PREFIX, SiteOfRequest
from dropanchor_service.security.identity import Scope


def sites_router(site_of: SiteOfRequest, routers: Iterable[APIRouter]) -> APIRouter:
    """Return the list of the sites, and below the id of each site the routes of these routers."""
    router = APIRouter()
    _add_list_route(router, site_of)
    for routes in routers:
        for route in _api_routes(routes):
            route.operation_id = route.unique_id = f"{route.operation_id}_of_site"
            route.responses = _with_unknown_site(route.responses)
        router.include_router(routes, prefix=SITE_PREFIX, dependencies=[SITE_IN_PATH])
    return router


def _with_unknown_site(responses: dict[int | str, dict[str, Any]]) -> dict[int | str, dict[str, Any]]:
    unknown = problems(Kind.UNKNOWN_SITE)[404]
    others = responses.get(404, {}).get("description", "")
    return responses | {404: unknown | {"description": f"{unknown['description']} {others}".rstrip()}}


def _api_routes(router: APIRouter) -> Iterator[APIRoute]:
    return (route for route in router.routes if isinstance(route, APIRoute))


def _add_list_route(router: APIRouter, sites: SiteOfRequest) -> None:
    @router.get(
        "/sites",
        operation_id="list_sites",
        summary="List the sites of the service",
        tags=["site"],
        response_model=SiteList,
        responses=example_response(examples.SITE_LIST) | problems(Kind.INVALID_REQUEST),
        dependencies=[NO_QUERY],
    )
    def list_sites(request: Request) -> Response:
        scope_in = getattr(request.state, "scope_in", lambda _: Scope.ADMIN)  # without authentication
        wanted = {one.id for one in sites if scope_in(one.id) is not None}
        return json_response({"sites": list(summaries([one.answers for one in sites], wanted))})
