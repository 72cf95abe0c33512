"""The route that tells how many tags are in each zone."""

from fastapi import APIRouter, Request
from starlette.responses import Response

from dropanchor_schemas.zones import ZoneOccupancyList
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.api.routes.events import reading
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response
from dropanchor_service.api.routes.site_of_request import parts_of

router = APIRouter(tags=["zones"], dependencies=[NO_QUERY])


@router.get(
    "/zone-occupancy",
    operation_id="get_zone_occupancy",
    summary="Count the tags in each zone",
    description="A tag counts from its entry to its exit, whether or not the zone makes events of them. "
    "Zones without a tag are left out.",
    response_model=ZoneOccupancyList,
    responses=example_response(examples.OCCUPANCY) | problems(Kind.INVALID_REQUEST, Kind.EVENTS_UNREADABLE),
)
def get_zone_occupancy(request: Request) -> Response:
    parts = parts_of(request).events
    with reading():
        counts = parts.store.occupancy()
    known = parts.items.zones.all
    return json_response({"zones": [{"zone": zone, "tags": tags} for zone, tags in counts if zone in known]})
