"""The route that tells when poses are stored."""

from typing import Annotated, Any

from fastapi import Query, Request
from pydantic import BaseModel, ConfigDict, Field
from starlette.responses import Response

from dropanchor_schemas.tracks import Coverage
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.parameters import TimeNs, example_response, json_response
from dropanchor_service.api.routes.period import history_of, reading_history, require_order
from dropanchor_service.api.routes.site_of_request import answers_of
from dropanchor_service.history.coverage import NO_COVERAGE
from dropanchor_service.history.tracks import Tracks

_EXAMPLE = {
    "from_ns": 1_799_996_400_000_000_000,
    "to_ns": 1_800_000_000_000_000_000,
    "step_ns": 10_000_000_000,
    "stretches": [{"from_ns": 1_799_998_200_000_000_000, "to_ns": 1_800_000_000_000_000_000}],
}


class CoverageQuery(BaseModel):
    """A period of any length, and how finely it is looked at."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    from_ns: TimeNs | None = Field(
        default=None,
        alias="from",
        description="Start of the period, UTC in ns, or ISO 8601 with a time zone. The default is the first pose.",
    )
    to_ns: TimeNs | None = Field(
        default=None,
        alias="to",
        description="End of the period, UTC in ns, or ISO 8601 with a time zone. The default is the last pose.",
    )
    max_parts: int = Field(
        default=400,
        ge=1,
        le=1000,
        description="The period is divided into at most so many parts, each of 10 s or more.",
    )


router = Router(tags=["poses"])


@router.get(
    "/history/coverage",
    summary="Get when poses are stored",
    description="When poses of any tag are stored. The period may have any length.",
    response_model=Coverage,
    responses=example_response(_EXAMPLE) | problems(Kind.NO_HISTORY, Kind.INVALID_REQUEST, Kind.HISTORY_UNREADABLE),
)
def get_history_coverage(query: Annotated[CoverageQuery, Query()], request: Request) -> Response:
    tracks = history_of(answers_of(request))
    with reading_history():
        return json_response(_coverage(tracks, query))


def _coverage(tracks: Tracks, query: CoverageQuery) -> dict[str, Any]:
    """Return the answer. Raises HistoryError and ProblemError."""
    if query.from_ns is not None and query.to_ns is not None:
        require_order(query.from_ns, query.to_ns)
    oldest, newest = tracks.reader.span() or (None, None)
    from_ns = oldest if query.from_ns is None else query.from_ns
    to_ns = newest if query.to_ns is None else query.to_ns
    found = NO_COVERAGE
    if from_ns is not None and to_ns is not None:
        if query.from_ns is None:  # the period that is asked for may lie before the first pose or after the last one
            from_ns = min(from_ns, to_ns)
        to_ns = max(from_ns, to_ns)
        found = tracks.reader.coverage(from_ns, to_ns, query.max_parts)
    stretches = [{"from_ns": start, "to_ns": end} for start, end in found.stretches]
    return {"from_ns": from_ns, "to_ns": to_ns, "step_ns": found.step_ns, "stretches": stretches}
