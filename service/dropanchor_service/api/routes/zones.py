"""The routes for zones, and for rules without a zone."""

from typing import Annotated

from fastapi import APIRouter, Body
from starlette.responses import Response

from dropanchor_schemas.zones import EventRule, EventRuleList, Zone, ZoneList
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.api.routes.items import (
    CHANGE_KINDS,
    IfMatch,
    RuleId,
    ZoneId,
    delete,
    found,
    item_response,
    put,
)
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response
from dropanchor_service.zones.items import ZoneItems
from dropanchor_service.zones.shapes import ShapeError, vertices_of

_READ = (Kind.INVALID_REQUEST,)


def zones_router(items: ZoneItems) -> APIRouter:
    router = APIRouter(tags=["zones"], dependencies=[NO_QUERY])
    _add_zone_routes(router, items)
    _add_rule_routes(router, items)
    return router


def _add_zone_routes(router: APIRouter, items: ZoneItems) -> None:
    zones = items.zones

    @router.get(
        "/zones",
        operation_id="list_zones",
        summary="List the zones",
        response_model=ZoneList,
        responses=example_response({"zones": [examples.ZONE]}) | problems(*_READ),
    )
    async def list_zones() -> Response:
        return json_response({"zones": [zone.model_dump() for zone in zones.all.values()]})

    @router.get(
        "/zones/{zone}",
        operation_id="get_zone",
        summary="Get a zone",
        response_model=Zone,
        responses=example_response(examples.ZONE) | problems(Kind.UNKNOWN_ZONE, *_READ),
    )
    async def get_zone(zone: ZoneId) -> Response:
        return item_response(found(zones, zone, Kind.UNKNOWN_ZONE))

    @router.put(
        "/zones/{zone}",
        operation_id="put_zone",
        summary="Create or replace a zone",
        description="Tags that are inside stay inside if the zone keeps its id. Edges of a polygon must not cross.",
        response_model=Zone,
        responses=example_response(examples.ZONE) | problems(Kind.SHAPE_REFUSED, *CHANGE_KINDS, *_READ),
    )
    def put_zone(
        zone: ZoneId, body: Annotated[Zone, Body(examples=[examples.ZONE])], if_match: IfMatch = None
    ) -> Response:
        try:
            vertices_of(body.shape)
        except ShapeError as error:
            raise ProblemError(Kind.SHAPE_REFUSED, f"body.shape: {error}.") from error
        put(zones, zone, body.id, body, if_match)
        return item_response(body)

    @router.delete(
        "/zones/{zone}",
        operation_id="delete_zone",
        summary="Delete a zone",
        description="Its events stay. Tags inside make no exit.",
        status_code=204,
        responses=problems(Kind.UNKNOWN_ZONE, Kind.CHANGED_MEANWHILE, Kind.NOT_SAVED, *_READ),
    )
    def delete_zone(zone: ZoneId, if_match: IfMatch = None) -> Response:
        return delete(zones, zone, if_match, Kind.UNKNOWN_ZONE)


def _add_rule_routes(router: APIRouter, items: ZoneItems) -> None:
    rules = items.rules

    @router.get(
        "/event-rules",
        operation_id="list_event_rules",
        summary="List the rules without a zone",
        response_model=EventRuleList,
        responses=example_response({"rules": [examples.RULE]}) | problems(*_READ),
    )
    async def list_event_rules() -> Response:
        return json_response({"rules": [rule.model_dump() for rule in rules.all.values()]})

    @router.get(
        "/event-rules/{rule}",
        operation_id="get_event_rule",
        summary="Get a rule",
        response_model=EventRule,
        responses=example_response(examples.RULE) | problems(Kind.UNKNOWN_RULE, *_READ),
    )
    async def get_event_rule(rule: RuleId) -> Response:
        return item_response(found(rules, rule, Kind.UNKNOWN_RULE))

    @router.put(
        "/event-rules/{rule}",
        operation_id="put_event_rule",
        summary="Create or replace a rule",
        response_model=EventRule,
        responses=example_response(examples.RULE) | problems(*CHANGE_KINDS, *_READ),
    )
    def put_event_rule(
        rule: RuleId, body: Annotated[EventRule, Body(examples=[examples.RULE])], if_match: IfMatch = None
    ) -> Response:
        put(rules, rule, body.id, body, if_match)
        return item_response(body)

    @router.delete(
        "/event-rules/{rule}",
        operation_id="delete_event_rule",
        summary="Delete a rule",
        status_code=204,
        responses=problems(Kind.UNKNOWN_RULE, Kind.CHANGED_MEANWHILE, Kind.NOT_SAVED, *_READ),
    )
    def delete_event_rule(rule: RuleId, if_match: IfMatch = None) -> Response:
        return delete(rules, rule, if_match, Kind.UNKNOWN_RULE)
