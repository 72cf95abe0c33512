"""The route for the values of settings: where each comes from, and what it hides."""

from typing import Annotated

from fastapi import Query, Request
from pydantic import Field
from starlette.responses import Response

from dropanchor_schemas.models import Exact
from dropanchor_schemas.settings_values import SettingSource, SettingValueList
from dropanchor_schemas.site import Id
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.known_tag import known_tag
from dropanchor_service.api.routes.parameters import example_response, json_response
from dropanchor_service.api.routes.site_of_request import answers_of
from dropanchor_service.store.settings_values import values_of_site, values_of_tag

_DESCRIPTION = """\
The values of the site, its anchors and its tags, those that were set over REST first; of tags, what is set for the tag
itself; with `tag`, all values of this one tag. A value that was set over REST wins over the command line, which wins
over the environment, then the settings file, then the default. Each value counts for itself: what nobody has set
follows the settings file.

To give a value back, put the first one in `hides` with the same route: a value that equals the configured one is not
kept as set."""
_EXAMPLE = {
    "values": [
        {
            "path": ["tags", "forklift-7", "height_m"],
            "source": "rest",
            "file": None,
            "at": [],
            "value": 1.4,
            "hides": [
                {"source": "file", "file": "yard.toml", "at": ["tag_defaults", "height_m"], "value": 1.2},
                {"source": "default", "file": None, "at": [], "value": 0.0},
            ],
        }
    ],
    "total": 1,
}


class SettingsQuery(Exact):
    tag: Id | None = Field(default=None, description="Return every value of this tag alone, also those by default.")
    source: list[SettingSource] = Field(
        default=[], description="Return only values from this source. Repeat the parameter for several."
    )
    limit: int = Field(default=1000, ge=1, le=100_000, description="Return at most this many values.")


router = Router(tags=["site"])


@router.get(
    "/settings",
    summary="List the values of settings, where they come from and what they hide",
    description=_DESCRIPTION,
    response_model=SettingValueList,
    responses=example_response(_EXAMPLE) | problems(Kind.UNKNOWN_TAG, Kind.INVALID_REQUEST),
)
def list_settings(query: Annotated[SettingsQuery, Query()], request: Request) -> Response:
    answers = answers_of(request)
    one = query.tag and known_tag(answers, query.tag).name
    values = list(values_of_tag(answers.site, one)) if one else values_of_site(answers.site)
    wanted = [value for value in values if not query.source or value.source in query.source]
    answer = {"values": [value.model_dump() for value in wanted[: query.limit]], "total": len(wanted)}
    return json_response(answer)
