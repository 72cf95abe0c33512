"""The route that tells how many tags are in each zone, and which."""

from typing import Annotated

from fastapi import Query, Request
from pydantic import Field
from starlette.responses import Response

from dropanchor_schemas.models import Exact
from dropanchor_schemas.zones import ZoneOccupancyList
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.api.routes.events import reading
from dropanchor_service.api.routes.parameters import example_response, json_response
from dropanchor_service.api.routes.site_of_request import parts_of

router = Router(tags=["zones"])


class OccupancyQuery(Exact):
    """Whether the tags are named."""

    names: bool = Field(default=False, description="Also list the tags in each zone.")


@router.get(
    "/zone-occupancy",
    summary="Count or list the tags in each zone",
    description="A tag counts from its entry to its exit, whether or not the zone makes events of them. "
    "Zones without a tag are left out.",
    response_model=ZoneOccupancyList,
    responses=example_response(examples.OCCUPANCY) | problems(Kind.INVALID_REQUEST, Kind.EVENTS_UNREADABLE),
)
def get_zone_occupancy(query: Annotated[OccupancyQuery, Query()], request: Request) -> Response:
    parts = parts_of(request).events
    with reading():
        found = parts.store.occupants()
    known = parts.items.zones.all
    return json_response(
        {
            "zones": [
                {"zone": zone, "tags": len(inside)}
                | ({"inside": [one._asdict() for one in inside]} if query.names else {})
                for zone, inside in found.items()
                if zone in known
            ]
        }
    )
