"""The route for the values of settings: where each comes from, and what it hides."""

from typing import Annotated

from fastapi import Query, Request
from pydantic import Field
from starlette.responses import Response

from dropanchor_schemas.models import Exact
from dropanchor_schemas.settings_values import SettingSource, SettingValueList
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.parameters import example_response, json_response
from dropanchor_service.api.routes.site_of_request import answers_of
from dropanchor_service.store.settings_values import values_of_site

_DESCRIPTION = """\
The values of the site, its anchors and its tags, those that were set over REST first; of tags, what is set for the tag
itself. A value that was set over REST wins over the command line, which wins over the environment, then the settings
file, then the default. Each value counts for itself: what nobody has set follows the settings file.

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
    responses=example_response(_EXAMPLE) | problems(Kind.INVALID_REQUEST),
)
def list_settings(query: Annotated[SettingsQuery, Query()], request: Request) -> Response:
    values = values_of_site(answers_of(request).site)
    wanted = [value for value in values if not query.source or value.source in query.source]
    answer = {"values": [value.model_dump() for value in wanted[: query.limit]], "total": len(wanted)}
    return json_response(answer)
