"""The route that says whether there is a history, and which time it covers."""

from fastapi import Request
from starlette.responses import Response

from dropanchor_schemas.tracks import History
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response
from dropanchor_service.api.routes.period import reading_history
from dropanchor_service.api.routes.site_of_request import answers_of

_EXAMPLE = {"enabled": True, "from_ns": 1_797_408_000_000_000_000, "to_ns": 1_800_000_000_000_000_000}


router = Router(tags=["poses"], dependencies=[NO_QUERY])


@router.get(
    "/history",
    summary="Get whether poses are stored, and which time they cover",
    response_model=History,
    responses=example_response(_EXAMPLE) | problems(Kind.INVALID_REQUEST, Kind.HISTORY_UNREADABLE),
)
def get_history(request: Request) -> Response:
    answers = answers_of(request)
    if answers.tracks is None:
        return json_response({"enabled": False, "from_ns": None, "to_ns": None})
    with reading_history():
        span = answers.tracks.reader.span()
    from_ns, to_ns = (None, None) if span is None else span
    return json_response({"enabled": True, "from_ns": from_ns, "to_ns": to_ns})
