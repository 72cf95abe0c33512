"""The routes for the base map: its description, and its tiles."""

from typing import TYPE_CHECKING, Annotated, Any, get_args

from fastapi import Header, Path, Request
from starlette.responses import Response

from dropanchor_schemas.basemap import Basemap, TileMediaType
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.contents import BYTES
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response
from dropanchor_service.api.routes.shared_parts import shared_of
from dropanchor_service.basemap.errors import UnreadableTileError

if TYPE_CHECKING:
    from dropanchor_service.basemap.basemap import ServedBasemap  # an extra

_NO_BASEMAP = Basemap(tiles=None)
_EXAMPLE = {
    "tiles": {
        "version": "0123456789abcdef",
        "media_type": "application/vnd.mapbox-vector-tile",
        "min_zoom": 10,
        "max_zoom": 15,
        "west": 13.3,
        "south": 52.4,
        "east": 13.5,
        "north": 52.6,
        "attribution": [
            {"text": "© ", "link": None},
            {"text": "OpenStreetMap", "link": "https://www.openstreetmap.org/copyright"},
        ],
    }
}
_TILE: dict[int | str, dict[str, Any]] = {
    200: {"content": dict.fromkeys(get_args(TileMediaType), BYTES)},
    204: {"description": "The base map has no such tile."},
    304: {"description": "The tile is the one that `If-None-Match` names."},
}

Zoom = Annotated[int, Path(ge=0, le=31, description="Zoom level.", examples=[15])]
Column = Annotated[int, Path(ge=0, lt=2**31, description="Column of the tile, from the west.", examples=[17604])]
Line = Annotated[int, Path(ge=0, lt=2**31, description="Line of the tile, from the north.", examples=[10749])]


router = Router(tags=["basemap"], dependencies=[NO_QUERY])


@router.get(
    "/basemap",
    summary="Get what the base map is, and who made it",
    response_model=Basemap,
    responses=example_response(_EXAMPLE) | problems(Kind.INVALID_REQUEST),
)
async def get_basemap(request: Request) -> Response:
    basemap = shared_of(request).basemap
    return json_response((_NO_BASEMAP if basemap is None else basemap.description).model_dump())


@router.get(
    "/basemap/{z}/{x}/{y}",
    summary="Get a tile of the base map",
    description="A tile in web Mercator, as OpenStreetMap numbers them. It is never compressed.",
    response_class=Response,
    responses=_TILE | problems(Kind.NO_BASEMAP, Kind.INVALID_REQUEST, Kind.BASEMAP_UNREADABLE),
)
def get_basemap_tile(
    z: Zoom,
    x: Column,
    y: Line,
    request: Request,
    if_none_match: Annotated[str, Header(description="The `ETag` of the tile that you have.")] = "",
) -> Response:
    basemap = shared_of(request).basemap
    if basemap is None:
        raise ProblemError(Kind.NO_BASEMAP, "The service has no base map: `basemap.tiles` is not set.")
    if max(x, y) >= 1 << z:
        raise ProblemError(Kind.INVALID_REQUEST, f"path: at zoom {z}, x and y are below {1 << z}")
    headers = {"etag": f'"{basemap.file.version}"', "cache-control": "private, no-cache"}
    if headers["etag"] in if_none_match:
        return Response(status_code=304, headers=headers)
    tile = _tile(basemap, z, x, y)
    if tile is None:
        return Response(status_code=204, headers=headers)
    return Response(tile, media_type=basemap.file.media_type, headers=headers)


def _tile(basemap: "ServedBasemap", z: int, x: int, y: int) -> bytes | None:
    try:
        return basemap.file.tile(z, x, y)
    except UnreadableTileError as error:
        raise ProblemError(Kind.BASEMAP_UNREADABLE, f"The file of the base map {error}.") from error
