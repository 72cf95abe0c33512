"""The sites that the service serves, and the routes that each of them has."""

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.routing import APIRoute
from starlette.responses import Response, StreamingResponse
from starlette.routing import BaseRoute

from dropanchor_schemas.answers import SiteList
from dropanchor_schemas.pose import SitePosesList
from dropanchor_service.answers.answers import to_json
from dropanchor_service.answers.site_summaries import summaries
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.below import below
from dropanchor_service.api.routes.parameters import NO_QUERY, PoseQuery, example_response, json_response
from dropanchor_service.api.routes.poses import in_pieces
from dropanchor_service.api.routes.site_of_request import SITE_IN_PATH, SITE_PREFIX, sites_of
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.security.identity import Scope

router = Router()


def routes_of_sites(routers: Iterable[APIRouter]) -> Iterator[BaseRoute]:
    """Yield the list of the sites, and below the id of each site the routes of these routers."""
    yield from router.routes
    for routes in routers:
        for route in below(SITE_PREFIX, routes.routes):
            if isinstance(route, APIRoute):
                _describe(route)
            yield route


def _describe(route: APIRoute) -> None:
    """Give a route below a site an id of its own, the site among its parameters, and the refusal of an unknown one."""
    route.operation_id = route.unique_id = f"{route.unique_id}_of_site"
    if route.response_field is not None:  # its name is the title of the schema
        route.response_field = copy(route.response_field)
        route.response_field.name = f"Response_{route.unique_id}"
    route.dependant = replace(route.dependant, dependencies=[SITE_IN_PATH, *route.dependant.dependencies])
    route.responses = _with_unknown_site(route.responses)


def _with_unknown_site(responses: dict[int | str, dict[str, Any]]) -> dict[int | str, dict[str, Any]]:
    unknown = problems(Kind.UNKNOWN_SITE)[404]
    others = responses.get(404, {}).get("description", "")
    return responses | {404: unknown | {"description": f"{unknown['description']} {others}".rstrip()}}


@router.get(
    "/sites",
    summary="List the sites of the service",
    tags=["site"],
    response_model=SiteList,
    responses=example_response(examples.SITE_LIST) | problems(Kind.INVALID_REQUEST),
    dependencies=[NO_QUERY],
)
def list_sites(request: Request) -> Response:
    wanted = {one.id for one in _readable(request)}
    return json_response({"sites": list(summaries([one.answers for one in sites_of(request)], wanted))})


@router.get(
    "/sites/poses",
    summary="List the latest poses of the tags of all sites",
    tags=["poses"],
    response_model=SitePosesList,
    responses=example_response({"sites": [{"site": "default", **examples.POSE_LIST}]}) | problems(Kind.INVALID_REQUEST),
)
async def list_poses_of_sites(query: Annotated[PoseQuery, Query()], request: Request) -> Response:
    chunks = _poses_json(_readable(request), query)
    return StreamingResponse(in_pieces(chunks), media_type="application/json", headers={"cache-control": "no-store"})


def _readable(request: Request) -> list[SiteParts]:
    """Return the sites that the client of a request may read."""
    scope_in = getattr(request.state, "scope_in", lambda _: Scope.ADMIN)  # without authentication
    return [one for one in sites_of(request) if scope_in(one.id) is not None]


def _poses_json(sites: Sequence[SiteParts], query: PoseQuery) -> Iterator[bytes | memoryview]:
    """Yield the JSON of a `SitePosesList`, in chunks."""
    before = b'{"sites":['
    for one in sites:
        answers = one.answers
        found = [tag for tag in map(answers.tags.find, query.tags) if tag is not None]
        poses = answers.pose_list_json(found if query.tags else None, query.wanted)
        yield b'%b{"site":%b,%b' % (before, to_json(one.id), bytes(next(poses))[1:])
        yield from poses
        before = b","
    yield b"]}" if sites else b'{"sites":[]}'
