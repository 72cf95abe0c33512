"""The routes for the site and its anchors."""

from typing import Annotated

from fastapi import Body, Request
from starlette.responses import Response

from dropanchor_schemas.answers import AnchorList
from dropanchor_schemas.sentences import said_by, say
from dropanchor_schemas.site import Anchor, Site
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.etags import Conditions
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.parameters import (
    NO_QUERY,
    AnchorId,
    example_response,
    json_response,
    resource_response,
    saving,
)
from dropanchor_service.api.routes.site_of_request import answers_of

_BAD_CHANGE = (Kind.BODY_TOO_LARGE, Kind.INVALID_REQUEST, Kind.NOT_SAVED)


router = Router(tags=["site"], dependencies=[NO_QUERY])


@router.get(
    "/site",
    summary="Get the site: its frame, georeference and anchors",
    description="The `ETag` of the answer can go into the `If-Match` of a change.",
    response_model=Site,
    responses=example_response(examples.SITE) | problems(Kind.INVALID_REQUEST),
)
async def get_site(request: Request) -> Response:
    return resource_response(answers_of(request).site.site)


@router.put(
    "/site",
    summary="Replace the site's frame, georeference and anchors",
    response_model=Site,
    responses=example_response(examples.SITE) | problems(Kind.SITE_ID_FIXED, Kind.CHANGED_MEANWHILE, *_BAD_CHANGE),
)
def put_site(body: Annotated[Site, Body(examples=[examples.SITE])], allows: Conditions, request: Request) -> Response:
    with saving():
        try:
            answers_of(request).site.set_site(body, allows)
        except ValueError as error:
            raise ProblemError(Kind.SITE_ID_FIXED, said_by(error)) from error
    return resource_response(body)


@router.get(
    "/anchors",
    summary="List the anchors of the site",
    response_model=AnchorList,
    responses=example_response({"anchors": [examples.ANCHOR]}) | problems(Kind.INVALID_REQUEST),
)
async def list_anchors(request: Request) -> Response:
    anchors = answers_of(request).site.site.anchors
    return json_response({"anchors": [anchor.model_dump() for anchor in anchors]})


@router.get(
    "/anchors/{anchor}",
    summary="Get an anchor",
    description="The `ETag` of the answer can go into the `If-Match` of a change.",
    response_model=Anchor,
    responses=example_response(examples.ANCHOR) | problems(Kind.UNKNOWN_ANCHOR, Kind.INVALID_REQUEST),
)
async def get_anchor(anchor: AnchorId, request: Request) -> Response:
    known = answers_of(request).site.anchor(anchor)
    if known is None:
        raise _unknown(anchor)
    return resource_response(known)


@router.put(
    "/anchors/{anchor}",
    summary="Create or move an anchor",
    response_model=Anchor,
    responses=example_response(examples.ANCHOR)
    | problems(Kind.ANCHOR_ID_DIFFERS, Kind.CHANGED_MEANWHILE, *_BAD_CHANGE),
)
def put_anchor(
    anchor: AnchorId,
    body: Annotated[Anchor, Body(examples=[examples.ANCHOR])],
    allows: Conditions,
    request: Request,
) -> Response:
    if body.id != anchor:
        raise ProblemError(
            Kind.ANCHOR_ID_DIFFERS,
            say(
                "id_differs",
                "The id is {path} in the path and {body} in the body.",
                path=repr(anchor),
                body=repr(body.id),
            ),
        )
    with saving():
        answers_of(request).site.set_anchor(body, allows)
    return resource_response(body)


@router.delete(
    "/anchors/{anchor}",
    summary="Remove an anchor from the site",
    status_code=204,
    responses=problems(Kind.UNKNOWN_ANCHOR, Kind.CHANGED_MEANWHILE, Kind.INVALID_REQUEST, Kind.NOT_SAVED),
)
def delete_anchor(anchor: AnchorId, allows: Conditions, request: Request) -> Response:
    with saving():
        try:
            answers_of(request).site.remove_anchor(anchor, allows)
        except KeyError as error:
            raise _unknown(anchor) from error
    return Response(status_code=204)


def _unknown(anchor: str) -> ProblemError:
    return ProblemError(
        Kind.UNKNOWN_ANCHOR, say("anchor_unknown", "The site has no anchor {anchor}.", anchor=repr(anchor))
    )
