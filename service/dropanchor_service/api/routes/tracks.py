"""The route for the tracks of many tags over a period: figures, and a few points of each."""

from typing import Annotated

from fastapi import Query, Request
from pydantic import Field
from starlette.responses import Response

from dropanchor_schemas.tracks import Tracks
from dropanchor_service.answers.many_tracks import many_tracks
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.parameters import TagFilter, example_response, json_response
from dropanchor_service.api.routes.period import Period, history_of, limits_of, reading_history
from dropanchor_service.api.routes.site_of_request import answers_of

_DESCRIPTION = """\
The distance, the tracked time and the speeds of each tag over a period, and a few of its stored poses: the first, the
last, those with which the state changes, others evenly in time and, over hours, those that the shape of the track
needs most. The tags share 200,000 points, so each has fewer than `max_points` where there are very many. Poses appear
about two seconds after they are computed."""


class TracksQuery(TagFilter, Period):
    """The tags, the period and the number of points."""

    max_points: int = Field(default=300, ge=2, le=5000, description="The maximum number of points of a tag.")


router = Router(tags=["poses"])


@router.get(
    "/tracks",
    summary="Get figures and points of the tracks of many tags",
    description=_DESCRIPTION,
    response_model=Tracks,
    responses=example_response(examples.TRACKS)
    | problems(Kind.NO_HISTORY, Kind.INVALID_REQUEST, Kind.HISTORY_UNREADABLE),
)
def get_tracks(query: Annotated[TracksQuery, Query()], request: Request) -> Response:
    answers = answers_of(request)
    from_ns, to_ns = limits_of(query, answers.now_ns())
    tracks = history_of(answers)
    with reading_history():
        floors = answers.site.floors
        return json_response(many_tracks(tracks, floors, query.tags or None, from_ns, to_ns, query.max_points))
