"""The route that exports the whole track of a tag over a period as a file."""

from collections.abc import Callable, Iterable, Iterator
from typing import Annotated, Any, Literal
from urllib.parse import quote

from fastapi import Query, Request
from pydantic import Field
from starlette.responses import StreamingResponse

from dropanchor_schemas.site import Site
from dropanchor_service.answers.answers import Answers
from dropanchor_service.answers.track_pages import TrackPage, track_page
from dropanchor_service.api.formats import geojson
from dropanchor_service.api.formats import track as track_formats
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.contents import BYTES
from dropanchor_service.api.routes.parameters import TagId
from dropanchor_service.api.routes.period import Period, history_of, limits_of, reading_history, require_known
from dropanchor_service.api.routes.site_of_request import answers_of
from dropanchor_service.api.routes.track import CONTENT

PAGE = 5000
PARQUET = "parquet"
MEDIA_TYPES = track_formats.MEDIA_TYPES | {PARQUET: "application/vnd.apache.parquet"}

_DESCRIPTION = """\
Every stored pose of a tag over a period, in one file. GeoJSON, GPX and KML need a georeferenced site. GPX and KML hold
only poses in the frame of the site that are `tracking`, `coasting` or `degraded`. Parquet needs the
extra `parquet` of the service; its schema holds the units and the frame. A pose whose state is `relative` has no place
in the site: CSV and Parquet have that in the tag's own frame in the columns `relative_…`."""


class FileQuery(Period):
    """The period to export, and the format of the file."""

    format: Literal["csv", "geojson", "gpx", "json", "kml", "parquet"] = Field(
        default="csv", description="The format of the file."
    )


def _offers() -> dict[int | str, dict[str, Any]]:
    """Return the response in the OpenAPI document. Clients are generated for the first media type: the default."""
    default = MEDIA_TYPES[track_formats.CSV]
    return {200: {"content": {default: CONTENT[default]} | CONTENT | {MEDIA_TYPES[PARQUET]: BYTES}}}


router = Router(tags=["poses"])


@router.get(
    "/tags/{tag}/track/file",
    summary="Export the track of a tag as a file",
    description=_DESCRIPTION,
    response_class=StreamingResponse,
    responses=_offers()
    | problems(
        *(Kind.UNKNOWN_TAG, Kind.NO_HISTORY, Kind.NOT_GEOREFERENCED, Kind.NOT_INSTALLED),
        *(Kind.INVALID_REQUEST, Kind.HISTORY_UNREADABLE),
    ),
)
def export_track(tag: TagId, query: Annotated[FileQuery, Query()], request: Request) -> StreamingResponse:
    answers = answers_of(request)
    if query.format in track_formats.GEOREFERENCED:
        geojson.require_georeference(answers, track_formats.GEOREFERENCED[query.format])
    to_parquet = _parquet() if query.format == PARQUET else None
    from_ns, to_ns = limits_of(query, answers.now_ns())
    head = {"tag": tag, "from_ns": from_ns, "to_ns": to_ns, "next": None}
    pages = _pages(answers, tag, from_ns, to_ns)
    if to_parquet is None:
        content = track_formats.stream(pages, head, query.format)
    else:
        content = to_parquet(pages, tag, answers.site.site)
    return StreamingResponse(
        content,
        media_type=MEDIA_TYPES[query.format],
        headers={"cache-control": "no-store", "content-disposition": _attachment(f"{tag}.{query.format}")},
    )


def _parquet() -> Callable[[Iterable[TrackPage], str, Site], Iterator[bytes]]:
    """Return what writes Parquet. Raises ProblemError without the extra."""
    try:
        from dropanchor_service.api.formats.parquet import stream
    except ModuleNotFoundError as error:
        detail = "Parquet needs the extra `parquet`: pip install 'dropanchor-service[parquet]'"
        raise ProblemError(Kind.NOT_INSTALLED, detail) from error
    return stream


def _pages(answers: Answers, tag: str, from_ns: int, to_ns: int) -> Iterator[TrackPage]:
    """Read the first page, and return an iterator over all pages. Raises ProblemError before it returns."""
    tracks = history_of(answers)
    with reading_history():
        require_known(answers, tracks, tag)
        first = track_page(tracks, answers.site, tag, from_ns, to_ns, PAGE)

    def every() -> Iterator[TrackPage]:
        page = first
        yield page
        while page.next_ns is not None:
            page = track_page(tracks, answers.site, tag, page.next_ns, to_ns, PAGE)
            yield page

    return every()


def _attachment(name: str) -> str:
    return f"attachment; filename*=UTF-8''{quote(name, safe='')}"
