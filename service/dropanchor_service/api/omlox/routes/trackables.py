"""The routes for trackables."""

from typing import Annotated

from fastapi import Body, Query
from starlette.responses import Response

from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.omlox.assets import Asset
from dropanchor_service.api.omlox.geojson import location_feature, motion_feature
from dropanchor_service.api.omlox.hub import Hub
from dropanchor_service.api.omlox.hub_of_request import SiteHub
from dropanchor_service.api.omlox.models import Feature, FeatureCollection, Location, TrackableMotion
from dropanchor_service.api.omlox.parameters import (
    LENIENT,
    ChangeQuery,
    PlaceQuery,
    SpatialQuery,
    TrackableId,
    errors,
    id_of_new,
    many,
    one,
)
from dropanchor_service.api.omlox.places import best_of
from dropanchor_service.api.omlox.routes.fences import fences_around
from dropanchor_service.api.omlox.trackable_changes import add, change, remove
from dropanchor_service.api.routes.parameters import json_response
from dropanchor_service.store.omlox_models import Fence, LocationProvider, Trackable

_UNKNOWN = Kind.UNKNOWN_TRACKABLE
_PLACED = (Kind.NOT_GEOREFERENCED,)
_SAVED = (Kind.ITEMS_FULL, Kind.PROVIDER_ASSIGNED, Kind.BODY_TOO_LARGE, Kind.NOT_SAVED)
EXAMPLE = {"type": "virtual", "name": "Forklift 3", "location_providers": ["tag-1"], "properties": {"fleet": "north"}}


router = Router(prefix="/trackables", tags=["trackables"], strict_content_type=LENIENT)


def found(hub: Hub, identifier: TrackableId) -> Asset:
    """Return the trackable with this id. Raises ProblemError."""
    asset = hub.assets.find(identifier)
    if asset is None:
        raise ProblemError(_UNKNOWN, f"There is no trackable with the id {identifier}.")
    return asset


@router.get("", summary="List the ids of the trackables", responses=errors())
def list_trackable_ids(hub: SiteHub) -> list[str]:
    return [str(asset.trackable.id) for asset in hub.assets.all()]


@router.get(
    "/summary",
    summary="List the trackables",
    response_model=list[Trackable],
    responses=errors(),
)
def list_trackables(hub: SiteHub) -> Response:
    return json_response(hub.trackables(hub.assets.all()))


@router.get(
    "/motions",
    summary="List the motions of all trackables whose place is known",
    response_model=list[TrackableMotion] | FeatureCollection,
    responses=errors(*_PLACED),
)
def list_motions(hub: SiteHub, query: Annotated[PlaceQuery, Query()]) -> Response:
    return many(hub.motions(hub.assets.all(), query.projection(hub)), query, motion_feature)


@router.post(
    "",
    summary="Create a trackable",
    description="A tag that it lists belongs to it from then on, instead of to a trackable of its own.",
    status_code=201,
    response_model=Trackable,
    responses=errors(Kind.EXISTS_ALREADY, *_SAVED),
)
def create_trackable(
    hub: SiteHub,
    trackable: Annotated[Trackable, Body(examples=[EXAMPLE])],
    query: Annotated[ChangeQuery, Query()],  # noqa: ARG001 - accepted, as the standard says
) -> Response:
    named = trackable.model_copy(update={"id": id_of_new(trackable.id)})
    return json_response(hub.trackables([add(hub, named)])[0], status=201)


@router.delete(
    "",
    summary="Delete all trackables that clients have created",
    status_code=204,
    responses=errors(Kind.NOT_SAVED),
)
def delete_trackables(hub: SiteHub) -> Response:
    for asset in hub.assets.all():
        if asset.own_tag is None:
            remove(hub, asset)
    return Response(status_code=204)


@router.get(
    "/{trackable_id}",
    summary="Get a trackable",
    response_model=Trackable,
    responses=errors(_UNKNOWN),
)
def get_trackable(hub: SiteHub, trackable_id: TrackableId) -> Response:
    return json_response(hub.trackables([found(hub, trackable_id)])[0])


@router.delete(
    "/{trackable_id}",
    summary="Delete a trackable that a client has created",
    description="Its tags get trackables of their own again.",
    status_code=204,
    responses=errors(_UNKNOWN, Kind.STANDS_FOR_A_TAG, Kind.NOT_SAVED),
)
def delete_trackable(hub: SiteHub, trackable_id: TrackableId) -> Response:
    remove(hub, found(hub, trackable_id))
    return Response(status_code=204)


@router.put(
    "/{trackable_id}",
    summary="Change a trackable",
    description="The name of a trackable that stands for a tag is the name of the tag.",
    response_model=Trackable,
    responses=errors(_UNKNOWN, Kind.ID_DIFFERS, Kind.STANDS_FOR_A_TAG, Kind.CHANGED_MEANWHILE, *_SAVED),
)
def put_trackable(
    hub: SiteHub,
    trackable_id: TrackableId,
    trackable: Annotated[Trackable, Body(examples=[EXAMPLE])],
    query: Annotated[ChangeQuery, Query()],  # noqa: ARG001 - accepted, as the standard says
) -> Response:
    return json_response(hub.trackables([change(hub, found(hub, trackable_id), trackable)])[0])


@router.get(
    "/{trackable_id}/location",
    summary="Get the location of a trackable: of its tag whose place is known best",
    response_model=Location | Feature,
    responses=errors(_UNKNOWN, Kind.NO_LOCATION, *_PLACED),
)
def get_trackable_location(hub: SiteHub, trackable_id: TrackableId, query: Annotated[PlaceQuery, Query()]) -> Response:
    tags = hub.assets.tags_of(found(hub, trackable_id).trackable)
    best = best_of(hub.places.of_tags(tags, query.projection(hub)))
    if best is None:
        raise hub.no_location(tags)
    return one(best, query, location_feature)


@router.get(
    "/{trackable_id}/locations",
    summary="List the locations of the tags of a trackable, as far as their place is known",
    response_model=list[Location] | FeatureCollection,
    responses=errors(_UNKNOWN, *_PLACED),
)
def list_trackable_locations(
    hub: SiteHub, trackable_id: TrackableId, query: Annotated[PlaceQuery, Query()]
) -> Response:
    tags = hub.assets.tags_of(found(hub, trackable_id).trackable)
    return many(hub.places.of_tags(tags, query.projection(hub)), query, location_feature)


@router.get(
    "/{trackable_id}/motion",
    summary="Get the motion of a trackable",
    response_model=TrackableMotion | Feature,
    responses=errors(_UNKNOWN, Kind.NO_LOCATION, *_PLACED),
)
def get_motion(hub: SiteHub, trackable_id: TrackableId, query: Annotated[PlaceQuery, Query()]) -> Response:
    asset = found(hub, trackable_id)
    motions = hub.motions([asset], query.projection(hub))
    if not motions:
        raise hub.no_location(hub.assets.tags_of(asset.trackable))
    return one(motions[0], query, motion_feature)


@router.get(
    "/{trackable_id}/providers",
    summary="List the tags of a trackable",
    response_model=list[LocationProvider],
    responses=errors(_UNKNOWN),
)
def list_trackable_providers(hub: SiteHub, trackable_id: TrackableId) -> Response:
    return json_response(hub.providers(hub.assets.tags_of(found(hub, trackable_id).trackable)))


@router.get(
    "/{trackable_id}/fences",
    summary="List the fences in which a trackable is",
    response_model=list[Fence],
    responses=errors(_UNKNOWN, Kind.EVENTS_UNREADABLE),
)
def list_trackable_fences(hub: SiteHub, trackable_id: TrackableId, query: Annotated[SpatialQuery, Query()]) -> Response:
    return fences_around(hub.assets.tags_of(found(hub, trackable_id).trackable), hub, query)
