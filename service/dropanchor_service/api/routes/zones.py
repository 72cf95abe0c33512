"""The routes for zones, and for rules without a zone."""

from fastapi import Request

from dropanchor_schemas.sentences import said_by, with_stop
from dropanchor_schemas.zones import EventRule, EventRuleList, Zone, ZoneList
from dropanchor_service.api.http.errors import Kind, ProblemError, at
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.api.routes.item_routes import Resource, add_item_routes
from dropanchor_service.api.routes.parameters import NO_QUERY
from dropanchor_service.api.routes.site_of_request import parts_of
from dropanchor_service.zones.shapes import ShapeError, vertices_of


def _zones() -> Resource[Zone]:
    return Resource(
        lambda request: parts_of(request).events.items.zones,
        path="zones",
        name="zone",
        list_summary="List the zones",
        model=Zone,
        list_model=ZoneList,
        example=examples.ZONE,
        unknown=Kind.UNKNOWN_ZONE,
        put_description="Tags that are inside stay inside if the zone keeps its id. Edges of a polygon must not cross.",
        delete_description="Its events stay. Tags inside make no exit.",
        check=_check_shape,
        refusals=(Kind.SHAPE_REFUSED,),
    )


def _rules() -> Resource[EventRule]:
    return Resource(
        lambda request: parts_of(request).events.items.rules,
        path="event-rules",
        name="rule",
        list_summary="List the rules without a zone",
        model=EventRule,
        list_model=EventRuleList,
        example=examples.RULE,
        unknown=Kind.UNKNOWN_RULE,
    )


def _check_shape(zone: Zone, _: Request) -> None:
    try:
        vertices_of(zone.shape)
    except ShapeError as error:
        raise ProblemError(Kind.SHAPE_REFUSED, at("body.shape", with_stop(said_by(error)))) from error


router = Router(tags=["zones"], dependencies=[NO_QUERY])
add_item_routes(router, _zones())
add_item_routes(router, _rules())
