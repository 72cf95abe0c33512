"""What the routes of the omlox interface share: query parameters, and how errors are documented."""

from collections.abc import Callable, Iterable
from typing import Annotated, Any, Literal
from uuid import UUID, uuid4

from fastapi import Depends, Path
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from starlette.responses import Response

from dropanchor_service.answers.answers import Answer
from dropanchor_service.api.http.errors import MEDIA_TYPE, Kind, ProblemError
from dropanchor_service.api.omlox.geojson import collection
from dropanchor_service.api.omlox.hub import Hub
from dropanchor_service.api.omlox.projection import Projection, projection_of
from dropanchor_service.api.omlox.zones import has_zone
from dropanchor_service.api.routes.parameters import id_of, json_response

LENIENT = False
"""Read a body without `content-type` as JSON: known clients send none. `Borders` keeps other pages out."""

_REFUSALS = (Kind.UNAUTHENTICATED, Kind.FORBIDDEN, Kind.OTHER_ORIGIN, Kind.OTHER_HOST, Kind.TOO_MANY_REQUESTS)
_UNNEEDED = "Accepted: positions and events are always up to date."


def _boolean(value: object) -> object:
    if value not in ("true", "false", True, False):
        raise ValueError("true or false was expected")
    return value


Flag = Annotated[bool, BeforeValidator(_boolean)]


class PlaceQuery(BaseModel):
    """The query of a route that returns positions. Parameters of other hubs are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    crs: Literal["local", "EPSG:4326"] | None = Field(
        default=None,
        description="`local`: the frame of the site, m. The default is EPSG:4326 if the site has a georeference.",
    )
    zone_id: str | None = Field(default=None, description="Id of a zone. All zones share the frame of the site.")
    geojson: Flag = Field(default=False, description="Return GeoJSON, in EPSG:4326.")

    def projection(self, hub: Hub) -> Projection:
        """Return the projection that the client asks for. Raises ProblemError."""
        require_zone(hub, self.zone_id)
        return projection_of(hub.answers.site.site, self.crs, self.geojson)


class SpatialQuery(BaseModel):
    """The query of a route that tells what is inside a fence."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    spatial_query: Flag = Field(
        default=False,
        description="Go by the position alone, instead of by the entries and exits, which need certainty.",
    )


class InsideQuery(PlaceQuery, SpatialQuery):
    """The query of a route that returns positions inside a fence."""


class ChangeQuery(BaseModel):
    """The query of a route that changes a trackable or a fence."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    force_location_update: Flag = Field(default=False, description=_UNNEEDED)
    subdivide: Flag = Field(default=False, description="Accepted: edges stay as they are, straight in the site frame.")


def require_zone(hub: Hub, name: str | None) -> None:
    """Raise ProblemError if there is no zone with this id."""
    if name is not None and not has_zone(hub.answers.site.site, name):
        raise ProblemError(Kind.INVALID_REQUEST, "query.zone_id: there is no zone with this id; see /zones.")


async def _provider_id(
    provider_id: Annotated[str, Path(description="Id of a tag, percent-escaped.", examples=["tag-1"])],
) -> str:
    return id_of(provider_id)


ProviderId = Annotated[str, Depends(_provider_id)]
TrackableId = Annotated[UUID, Path(alias="trackable_id")]
ZoneId = Annotated[UUID, Path(alias="zone_id")]
FenceId = Annotated[UUID, Path(alias="fence_id")]


def id_of_new(identifier: UUID | None) -> UUID:
    """Return the id that a client chose for a new object, or a random one. The id of zeros is no choice."""
    return identifier if identifier is not None and identifier.int else uuid4()


def require_id(expected: UUID | str, stated: UUID | str | None) -> None:
    """Raise ProblemError if a body states another id than the path. The id of zeros states none."""
    if stated not in (None, expected, UUID(int=0)):
        raise ProblemError(Kind.ID_DIFFERS, f"The id is {expected} in the path and {stated} in the body.")


def exists_already(name: str, identifier: UUID | str) -> ProblemError:
    """Return the problem of creating an object with an id that another one has."""
    return ProblemError(Kind.EXISTS_ALREADY, f"There is a {name} with the id {identifier}: change it with PUT.")


def one(found: Answer, query: PlaceQuery, as_feature: Callable[[Answer], Answer]) -> Response:
    """Return an object, or its GeoJSON."""
    return json_response(as_feature(found) if query.geojson else found)


def many(found: Iterable[Answer], query: PlaceQuery, as_feature: Callable[[Answer], Answer]) -> Response:
    """Return a list of objects, or its GeoJSON."""
    return json_response(collection(map(as_feature, found)) if query.geojson else list(found))


def errors(*kinds: Kind) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI responses of a route that can fail with these kinds."""
    content = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/OmloxProblem"}}}
    by_status: dict[int | str, dict[str, Any]] = {}
    for kind in (*_REFUSALS, Kind.INVALID_REQUEST, *kinds):
        status = 400 if kind.status == 422 else kind.status
        earlier = by_status.get(status, {}).get("description")
        by_status[status] = {
            "description": f"{earlier} {kind.title}." if earlier else f"{kind.title}.",
            "content": content,
        }
    return by_status
