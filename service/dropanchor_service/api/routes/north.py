"""The route for what the tags of a site tell about north."""

from fastapi import Request
from starlette.responses import Response

from dropanchor_schemas.north import SiteNorth
from dropanchor_service.answers.north import site_north_of
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response
from dropanchor_service.api.routes.site_of_request import answers_of

_EXAMPLE = {
    "declination_rad": 0.07,
    "learned_rad": -0.54,
    "std_rad": 0.12,
    "tags": [
        {"tag": "tag-1", "declination_rad": -0.51, "std_rad": 0.09},
        {"tag": "tag-4", "declination_rad": -0.57, "std_rad": 0.11},
    ],
    "offered": True,
    "text": "2 tags of this site that know where they started say that north is 35° ± 14° off. Apply that to all.",
    "phrase": {"code": "site_north", "values": {"tags": "2", "error": "35", "within": "14"}},
}


router = Router(tags=["site"], dependencies=[NO_QUERY])


@router.get(
    "/site/north",
    summary="Get where north is, as the tags tell it whose start and heading were told",
    description="Nothing follows from it by itself. To apply it to all tags, put the site with `learned_rad` as "
    "its `declination_rad` and `std_rad` as its `declination_std_rad`: tags that know north by their own start go "
    "on, and the others start again.",
    response_model=SiteNorth,
    responses=example_response(_EXAMPLE) | problems(Kind.INVALID_REQUEST),
)
async def get_site_north(request: Request) -> Response:
    return json_response(site_north_of(answers_of(request)))
