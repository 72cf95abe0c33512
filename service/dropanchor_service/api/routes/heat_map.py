"""The route that tells for how long tags were where over a period."""

from typing import Annotated, Any

import numpy as np
from fastapi import Query, Request
from pydantic import Field
from starlette.responses import Response

from dropanchor_schemas.heat_map import HeatMap
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.parameters import example_response, json_response
from dropanchor_service.api.routes.period import TagsInPeriod, history_of, limits_of, reading_history, selected_tags
from dropanchor_service.api.routes.site_of_request import answers_of
from dropanchor_service.history.heat_cells import LARGEST_M, SMALLEST_M
from dropanchor_service.history.heat_map import MAX_SQUARES
from dropanchor_service.history.tracks import Tracks

_DESCRIPTION = f"""\
How long tags were in each cell of a grid, from their stored poses: a tag stays where it was until its next pose, for at
most 10 s. Only poses that are `tracking`, `coasting` or `degraded` in the frame of the site are places; the time of all
others is `left_out_s`. There are at most {MAX_SQUARES:,} cells: they become larger until these suffice."""

_EXAMPLE = {
    "from_ns": 1_799_996_400_000_000_000,
    "to_ns": 1_800_000_000_000_000_000,
    "tags": 2,
    "cell_m": 1.0,
    "placed_s": 7040.0,
    "left_out_s": 160.0,
    "cells": {"x": [3.5, 4.5], "y": [-1.5, -1.5], "seconds": [3600.0, 3440.0]},
}


class HeatMapQuery(TagsInPeriod):
    """The tags, the period and the size of the cells."""

    cell_m: float = Field(
        default=1.0,
        ge=SMALLEST_M,
        le=LARGEST_M,
        description="The side of a cell, rounded up to 0.5 m, 1 m, 2 m, 4 m and so on.",
    )


router = Router(tags=["poses"])


@router.get(
    "/heat-map",
    summary="Get for how long tags were where",
    description=_DESCRIPTION,
    response_model=HeatMap,
    responses=example_response(_EXAMPLE) | problems(Kind.NO_HISTORY, Kind.INVALID_REQUEST, Kind.HISTORY_UNREADABLE),
)
def get_heat_map(query: Annotated[HeatMapQuery, Query()], request: Request) -> Response:
    answers = answers_of(request)
    from_ns, to_ns = limits_of(query, answers.now_ns())
    tracks = history_of(answers)
    with reading_history():
        tags = selected_tags(answers, tracks, query)
        return json_response(_heat_map(tracks, tags, from_ns, to_ns, query.cell_m))


def _heat_map(tracks: Tracks, tags: list[str] | None, from_ns: int, to_ns: int, cell_m: float) -> dict[str, Any]:
    found = tracks.reader.heat_map(tags, from_ns, to_ns, cell_m)
    seconds = np.round(found.seconds, 3)
    return {
        "from_ns": from_ns,
        "to_ns": to_ns,
        "tags": found.tags,
        "cell_m": found.cell_m,
        "placed_s": round(float(seconds.sum()), 3),
        "left_out_s": round(found.left_out_s, 3),
        "cells": {"x": found.x, "y": found.y, "seconds": seconds},
    }
