"""The route for the track of a tag: its stored poses, page by page."""

from typing import Annotated, Any, Literal
from urllib.parse import urlencode

from fastapi import Query, Request
from pydantic import Field, field_validator
from starlette.responses import Response

from dropanchor_schemas.geojson import TrackFeatureCollection
from dropanchor_schemas.sentences import say
from dropanchor_schemas.track import Track
from dropanchor_service.answers.answers import Answers
from dropanchor_service.answers.track_pages import TrackPage, track_page
from dropanchor_service.api.formats import geojson
from dropanchor_service.api.formats import track as track_formats
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.contents import TEXT, schema_of
from dropanchor_service.api.routes.parameters import TagId
from dropanchor_service.api.routes.period import Period, history_of, limits_of, reading_history, require_known
from dropanchor_service.api.routes.site_of_request import answers_of

MAX_POSES = 10_000
_PARQUET_IS_A_FILE = say(
    "parquet_is_a_file",
    "Parquet comes as one file, not page by page: {path}. It needs the extra `parquet` of the service: {command}",
    path="/api/v1/tags/TAG/track/file?format=parquet",
    command="pip install 'dropanchor-service[parquet]'",
)

_DESCRIPTION = """\
The stored poses of a tag in order of time. The settings of the service say how many poses it stores. It writes them
about two seconds after they are computed. A page holds up to `limit` poses. `next`, and the header `Link` with
rel="next", lead to the next page. GeoJSON, GPX and KML need a georeferenced site. GPX and KML hold only poses
that are `tracking`, `coasting` or `degraded`."""


class TrackQuery(Period):
    """The part of a track to return, and its format."""

    limit: int = Field(default=1000, ge=1, le=MAX_POSES, description="The maximum number of poses on a page.")
    cursor: int | None = Field(default=None, ge=0, lt=2**62, description="The value of `next` on the previous page.")
    format: Literal["json", "geojson", "csv", "gpx", "kml"] | None = Field(
        default=None, description="The format of the response. The default depends on the header `Accept`."
    )

    @field_validator("format", mode="before")
    @classmethod
    def _has_pages(cls, value: object) -> object:
        """Say where Parquet is: who looks for it here would otherwise take it for missing."""
        if value == "parquet":
            raise ValueError(_PARQUET_IS_A_FILE)
        return value


CONTENT: dict[str, Any] = {
    track_formats.MEDIA_TYPES[track_formats.JSON]: {"schema": schema_of(Track)},
    track_formats.MEDIA_TYPES[track_formats.GEOJSON]: {"schema": schema_of(TrackFeatureCollection)},
    track_formats.MEDIA_TYPES[track_formats.CSV]: TEXT,
    track_formats.MEDIA_TYPES[track_formats.GPX]: TEXT,
    track_formats.MEDIA_TYPES[track_formats.KML]: TEXT,
}
"""The media types of a track in the OpenAPI document."""


def _offers() -> dict[int | str, dict[str, Any]]:
    return {200: {"content": CONTENT | {"application/json": {"example": examples.TRACK}}}}


router = Router(tags=["poses"])


@router.get(
    "/tags/{tag}/track",
    summary="Get the track of a tag",
    description=_DESCRIPTION,
    response_model=Track,
    responses=_offers()
    | problems(
        *(Kind.UNKNOWN_TAG, Kind.NO_HISTORY, Kind.NOT_ACCEPTABLE, Kind.NOT_GEOREFERENCED),
        *(Kind.INVALID_REQUEST, Kind.HISTORY_UNREADABLE),
    ),
)
def get_track(tag: TagId, query: Annotated[TrackQuery, Query()], request: Request) -> Response:
    answers, form = answers_of(request), track_formats.negotiate(request, query.format)
    if form in track_formats.GEOREFERENCED:
        geojson.require_georeference(answers, track_formats.GEOREFERENCED[form])
    from_ns, to_ns = limits_of(query, answers.now_ns())
    page = _page(answers, tag, max(from_ns, query.cursor or 0), to_ns, query.limit)
    following = None if page.next_ns is None else str(page.next_ns)
    head = {"tag": tag, "from_ns": from_ns, "to_ns": to_ns, "next": following}
    headers = {"cache-control": "no-store", "vary": "accept"}
    if following is not None:
        headers["link"] = _link({"from": from_ns, "to": to_ns, "limit": query.limit, "cursor": following}, form)
    media_type = track_formats.MEDIA_TYPES[form]
    return Response(track_formats.encode(page, head, form), media_type=media_type, headers=headers)


def _page(answers: Answers, tag: str, from_ns: int, to_ns: int, limit: int) -> TrackPage:
    tracks = history_of(answers)
    with reading_history():
        require_known(answers, tracks, tag)
        return track_page(tracks, answers.site, tag, from_ns, to_ns, limit)


def _link(query: dict[str, Any], form: str) -> str:
    return f'<?{urlencode(query | {"format": form})}>; rel="next"'
