"""The routes for location providers, which are the tags."""

from typing import Annotated

from fastapi import Body, Query
from starlette.responses import Response

from dropanchor_schemas.keys import InvalidKeyError, chunk_from_id
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.omlox.geojson import location_feature
from dropanchor_service.api.omlox.hub import Hub
from dropanchor_service.api.omlox.hub_of_request import SiteHub
from dropanchor_service.api.omlox.models import Feature, FeatureCollection, Location
from dropanchor_service.api.omlox.own_properties import without_own
from dropanchor_service.api.omlox.parameters import (
    LENIENT,
    PlaceQuery,
    ProviderId,
    SpatialQuery,
    errors,
    exists_already,
    many,
    one,
    require_id,
)
from dropanchor_service.api.omlox.routes.fences import fences_around
from dropanchor_service.api.omlox.trackable_changes import forget, name_tag, save
from dropanchor_service.api.routes.known_tag import known_tag
from dropanchor_service.api.routes.parameters import json_response, saving
from dropanchor_service.store.omlox_models import Fence, LocationProvider, Trackable
from dropanchor_service.store.tags import Tag

_UNKNOWN = Kind.UNKNOWN_TAG
_SAVED = (Kind.NOT_OFFERED, Kind.TAGS_FULL, Kind.CHANGED_MEANWHILE, Kind.BODY_TOO_LARGE, Kind.NOT_SAVED)
EXAMPLE = {"id": "tag-1", "type": "uwb", "name": "Forklift 3", "properties": {"fleet": "north"}}
TAKES_NO_POSITIONS = (
    "This service computes the locations of its tags from ranges and inertial samples. It takes none from elsewhere: "
    "send samples with a tag client, or locations to the hub that reads this one."
)


router = Router(prefix="/providers", tags=["providers"], strict_content_type=LENIENT)


@router.get("", summary="List the ids of the tags", responses=errors())
def list_provider_ids(hub: SiteHub) -> list[str]:
    return [tag.name for tag in hub.answers.tags.listed()]


@router.get(
    "/summary",
    summary="List the tags as location providers",
    response_model=list[LocationProvider],
    responses=errors(),
)
def list_providers(hub: SiteHub) -> Response:
    return json_response(hub.providers(hub.answers.tags.listed()))


@router.get(
    "/locations",
    summary="List the locations of all tags whose place is known",
    response_model=list[Location] | FeatureCollection,
    responses=errors(Kind.NOT_GEOREFERENCED),
)
def list_locations(hub: SiteHub, query: Annotated[PlaceQuery, Query()]) -> Response:
    return many(hub.places.of_tags(hub.answers.tags.listed(), query.projection(hub)), query, location_feature)


@router.post(
    "",
    summary="Register a tag",
    status_code=201,
    response_model=LocationProvider,
    responses=errors(Kind.EXISTS_ALREADY, *_SAVED),
)
def create_provider(hub: SiteHub, provider: Annotated[LocationProvider, Body(examples=[EXAMPLE])]) -> Response:
    known = hub.answers.tags.find(provider.id)
    if known is not None and not hub.answers.tags.is_deleted(known.row):
        raise exists_already("tag", provider.id)
    return json_response(hub.providers([_saved(hub, provider)])[0], status=201)


"""Add the routes on which other hubs take positions. They answer why this one does not."""


async def refuse() -> None:
    raise ProblemError(Kind.NOT_OFFERED, TAKES_NO_POSITIONS)


async def refuse_of(provider_id: ProviderId) -> None:  # noqa: ARG001 - the document names it
    await refuse()


for what, path in (("location", "locations"), ("proximity", "proximities")):
    for operation, route, answer in ((what, f"/{{provider_id}}/{what}", refuse_of), (path, f"/{path}", refuse)):
        router.add_api_route(
            route,
            answer,
            methods=["PUT"],
            operation_id=f"put_{operation}",
            summary="Refused: this service computes positions and takes none",
            status_code=204,
            responses=errors(Kind.NOT_OFFERED),
        )


@router.get(
    "/{provider_id}",
    summary="Get a tag as location provider",
    response_model=LocationProvider,
    responses=errors(_UNKNOWN),
)
def get_provider(hub: SiteHub, provider_id: ProviderId) -> Response:
    return json_response(hub.providers([known_tag(hub.answers, provider_id)])[0])


@router.put(
    "/{provider_id}",
    summary="Set the name and the properties of a tag",
    status_code=204,
    responses=errors(_UNKNOWN, Kind.ID_DIFFERS, *_SAVED),
)
def put_provider(
    hub: SiteHub, provider_id: ProviderId, provider: Annotated[LocationProvider, Body(examples=[EXAMPLE])]
) -> Response:
    known_tag(hub.answers, provider_id)
    require_id(provider_id, provider.id)
    _saved(hub, provider)
    return Response(status_code=204)


@router.delete(
    "/{provider_id}",
    summary="Delete a tag: its settings, its counters and its pose",
    description="A tag that still sends is back with its next message.",
    status_code=204,
    responses=errors(_UNKNOWN, Kind.CHANGED_MEANWHILE, Kind.NOT_SAVED),
)
def delete_provider(hub: SiteHub, provider_id: ProviderId) -> Response:
    tag = known_tag(hub.answers, provider_id)
    forget(hub.items.providers, tag.name)
    forget(hub.items.tag_trackables, tag.name)
    with saving():
        hub.answers.site.remove_tag(tag.name, hub.answers.now_ns())
    hub.answers.forget(tag)
    return Response(status_code=204)


@router.get(
    "/{provider_id}/location",
    summary="Get the location of a tag",
    response_model=Location | Feature,
    responses=errors(_UNKNOWN, Kind.NO_LOCATION, Kind.NOT_GEOREFERENCED),
)
def get_provider_location(hub: SiteHub, provider_id: ProviderId, query: Annotated[PlaceQuery, Query()]) -> Response:
    tag = known_tag(hub.answers, provider_id)
    locations = hub.places.of_tags([tag], query.projection(hub))
    if not locations:
        raise hub.no_location([tag])
    return one(locations[0], query, location_feature)


@router.get(
    "/{provider_id}/trackables",
    summary="List the trackable that carries a tag",
    response_model=list[Trackable],
    responses=errors(_UNKNOWN),
)
def list_provider_trackables(hub: SiteHub, provider_id: ProviderId) -> Response:
    return json_response(hub.trackables(hub.assets.of_tags([known_tag(hub.answers, provider_id)])))


@router.get(
    "/{provider_id}/fences",
    summary="List the fences in which a tag is",
    response_model=list[Fence],
    responses=errors(_UNKNOWN, Kind.EVENTS_UNREADABLE),
)
def list_provider_fences(hub: SiteHub, provider_id: ProviderId, query: Annotated[SpatialQuery, Query()]) -> Response:
    return fences_around([known_tag(hub.answers, provider_id)], hub, query)


def _saved(hub: Hub, provider: LocationProvider) -> Tag:
    """Save a provider, and its name as that of the tag. Raises ProblemError."""
    if provider.type not in ("uwb", "unknown"):
        raise ProblemError(Kind.NOT_OFFERED, f"This service locates UWB tags, no providers of type {provider.type}.")
    try:
        chunk_from_id(provider.id)
    except InvalidKeyError as error:
        raise ProblemError(Kind.INVALID_REQUEST, f"body.id: cannot be the id of a tag: {error}.") from error
    tag = name_tag(hub, provider.id, provider.name)
    update = {"type": "uwb", "name": None, "properties": without_own(provider.properties)}
    save(hub.items.providers, provider.id, provider.model_copy(update=update))
    return tag
