"""The routes for fences, which are the zones of this service."""

from collections.abc import Sequence
from typing import Annotated

from fastapi import Body, Query
from starlette.responses import Response

from dropanchor_service.api.http.errors import Kind
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.omlox.geojson import fence_feature, location_feature, motion_feature
from dropanchor_service.api.omlox.hub import Hub
from dropanchor_service.api.omlox.hub_of_request import SiteHub
from dropanchor_service.api.omlox.models import Feature, FeatureCollection, Location, TrackableMotion
from dropanchor_service.api.omlox.parameters import (
    LENIENT,
    ChangeQuery,
    FenceId,
    InsideQuery,
    PlaceQuery,
    SpatialQuery,
    errors,
    exists_already,
    id_of_new,
    many,
    one,
    require_id,
)
from dropanchor_service.api.omlox.projection import projection_of
from dropanchor_service.api.routes.parameters import json_response
from dropanchor_service.store.omlox_models import Fence, LocationProvider, Trackable
from dropanchor_service.store.tags import Tag

_UNKNOWN = Kind.UNKNOWN_FENCE
_PLACED = (Kind.NOT_GEOREFERENCED,)
_INSIDE = (_UNKNOWN, Kind.EVENTS_UNREADABLE)
_SAVED = (Kind.ITEMS_FULL, Kind.BODY_TOO_LARGE, Kind.NOT_SAVED, *_PLACED)
EXAMPLE = {
    "name": "Dock",
    "region": {
        "type": "Polygon",
        "coordinates": [[[13.4, 52.5], [13.4002, 52.5], [13.4002, 52.5001], [13.4, 52.5]]],
    },
    "crs": "EPSG:4326",
}


router = Router(prefix="/fences", tags=["fences"], strict_content_type=LENIENT)


def fences_around(tags: Sequence[Tag], hub: Hub, query: SpatialQuery) -> Response:
    """Return the fences in which one of these tags is."""
    zones = hub.inside.zones_of(tags, query.spatial_query, hub.fences.all())
    projection = projection_of(hub.answers.site.site, None)
    return json_response([hub.fences.answer(zone, projection) for zone in zones])


@router.get("", summary="List the ids of the fences", responses=errors())
def list_fence_ids(hub: SiteHub) -> list[str]:
    return [str(hub.fences.id_of(zone.id)) for zone in hub.fences.all()]


@router.get(
    "/summary",
    summary="List the fences",
    response_model=list[Fence] | FeatureCollection,
    responses=errors(*_PLACED),
)
def list_fences(hub: SiteHub, query: Annotated[PlaceQuery, Query()]) -> Response:
    projection = query.projection(hub)
    return many([hub.fences.answer(zone, projection) for zone in hub.fences.all()], query, fence_feature)


@router.post(
    "",
    summary="Create a fence",
    description="It is a zone of this service from then on: a polygon without holes, or a circle around a point.",
    status_code=201,
    response_model=Fence,
    responses=errors(Kind.SHAPE_REFUSED, Kind.EXISTS_ALREADY, *_SAVED),
)
def create_fence(
    hub: SiteHub,
    fence: Annotated[Fence, Body(examples=[EXAMPLE])],
    query: Annotated[ChangeQuery, Query()],  # noqa: ARG001 - accepted, as the standard says
) -> Response:
    identifier = id_of_new(fence.id)
    if any(hub.fences.id_of(zone.id) == identifier for zone in hub.fences.all()):
        raise exists_already("fence", identifier)
    zone = hub.fences.save(str(identifier), fence, None)
    projection = projection_of(hub.answers.site.site, fence.crs)
    return json_response(hub.fences.answer(zone, projection), status=201)


@router.delete(
    "",
    summary="Delete all fences, which are all zones of this service",
    status_code=204,
    responses=errors(Kind.NOT_SAVED),
)
def delete_fences(hub: SiteHub) -> Response:
    for zone in hub.fences.all():
        hub.fences.delete(zone)
    return Response(status_code=204)


@router.get(
    "/{fence_id}",
    summary="Get a fence",
    response_model=Fence | Feature,
    responses=errors(_UNKNOWN, *_PLACED),
)
def get_fence(hub: SiteHub, fence_id: FenceId, query: Annotated[PlaceQuery, Query()]) -> Response:
    return one(hub.fences.answer(hub.fences.find(fence_id), query.projection(hub)), query, fence_feature)


@router.delete(
    "/{fence_id}",
    summary="Delete a fence",
    description="Its events stay. What is inside makes no exit.",
    status_code=204,
    responses=errors(_UNKNOWN, Kind.NOT_SAVED),
)
def delete_fence(hub: SiteHub, fence_id: FenceId) -> Response:
    hub.fences.delete(hub.fences.find(fence_id))
    return Response(status_code=204)


@router.put(
    "/{fence_id}",
    summary="Change a fence",
    description="What only the zone has, such as the tags it concerns and its delay, stays as it is.",
    status_code=204,
    responses=errors(_UNKNOWN, Kind.SHAPE_REFUSED, Kind.ID_DIFFERS, *_SAVED),
)
def put_fence(
    hub: SiteHub,
    fence_id: FenceId,
    fence: Annotated[Fence, Body(examples=[EXAMPLE])],
    query: Annotated[ChangeQuery, Query()],  # noqa: ARG001 - accepted, as the standard says
) -> Response:
    present = hub.fences.find(fence_id)
    require_id(fence_id, fence.id)
    hub.fences.save(present.id, fence, present)
    return Response(status_code=204)


@router.get(
    "/{fence_id}/locations",
    summary="List the locations of the tags in a fence",
    response_model=list[Location] | FeatureCollection,
    responses=errors(*_INSIDE, *_PLACED),
)
def list_fence_locations(hub: SiteHub, fence_id: FenceId, query: Annotated[InsideQuery, Query()]) -> Response:
    tags = _tags_in(hub, fence_id, query)
    return many(hub.places.of_tags(tags, query.projection(hub)), query, location_feature)


@router.get(
    "/{fence_id}/motions",
    summary="List the motions of the trackables in a fence",
    response_model=list[TrackableMotion] | FeatureCollection,
    responses=errors(*_INSIDE, *_PLACED),
)
def list_fence_motions(hub: SiteHub, fence_id: FenceId, query: Annotated[InsideQuery, Query()]) -> Response:
    assets = hub.assets.of_tags(_tags_in(hub, fence_id, query))
    return many(hub.motions(assets, query.projection(hub)), query, motion_feature)


@router.get(
    "/{fence_id}/providers",
    summary="List the tags in a fence",
    response_model=list[LocationProvider],
    responses=errors(*_INSIDE),
)
def list_fence_providers(hub: SiteHub, fence_id: FenceId, query: Annotated[SpatialQuery, Query()]) -> Response:
    return json_response(hub.providers(_tags_in(hub, fence_id, query)))


@router.get(
    "/{fence_id}/trackables",
    summary="List the trackables in a fence",
    response_model=list[Trackable],
    responses=errors(*_INSIDE),
)
def list_fence_trackables(hub: SiteHub, fence_id: FenceId, query: Annotated[SpatialQuery, Query()]) -> Response:
    return json_response(hub.trackables(hub.assets.of_tags(_tags_in(hub, fence_id, query))))


def _tags_in(hub: Hub, fence_id: FenceId, query: SpatialQuery) -> list[Tag]:
    tags = {tag.name: tag for tag in hub.answers.tags.listed()}
    return hub.inside.tags_in(hub.fences.find(fence_id), query.spatial_query, tags)
