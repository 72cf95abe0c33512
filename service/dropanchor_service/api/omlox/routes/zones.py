"""The routes for omlox zones. Whoever changes the site changes them."""

from typing import Annotated

from fastapi import Query
from starlette.responses import Response

from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.omlox.hub_of_request import SiteHub
from dropanchor_service.api.omlox.models import Zone
from dropanchor_service.api.omlox.parameters import ZoneId, errors
from dropanchor_service.api.omlox.zones import zone_answers
from dropanchor_service.api.routes.parameters import json_response

ForeignId = Annotated[str | None, Query(description="Return only the zone of the anchor with this id.")]


router = Router(prefix="/zones", tags=["zones"])


@router.get("", summary="List the ids of the zones", responses=errors())
def list_zone_ids(hub: SiteHub, foreign_id: ForeignId = None) -> list[str]:
    return [zone["id"] for zone in zone_answers(hub.answers.site.site, foreign_id)]


@router.get(
    "/summary",
    summary="List the zones: one around each anchor",
    response_model=list[Zone],
    responses=errors(),
)
def list_zones(hub: SiteHub, foreign_id: ForeignId = None) -> Response:
    return json_response(list(zone_answers(hub.answers.site.site, foreign_id)))


@router.get(
    "/{zone_id}",
    summary="Get a zone",
    response_model=Zone,
    responses=errors(Kind.UNKNOWN_ZONE),
)
def get_zone(hub: SiteHub, zone_id: ZoneId) -> Response:
    for zone in zone_answers(hub.answers.site.site):
        if zone["id"] == str(zone_id):
            return json_response(zone)
    raise ProblemError(Kind.UNKNOWN_ZONE, f"There is no zone with the id {zone_id}.")
