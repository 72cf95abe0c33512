"""The route that tells a client what it may do, so that a page offers only what works."""

from fastapi import Request
from starlette.responses import Response

from dropanchor_schemas.answers import ClientAccess
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response
from dropanchor_service.api.routes.site_of_request import answers_of
from dropanchor_service.security.identity import Scope

router = Router(tags=["site"], dependencies=[NO_QUERY])


@router.get(
    "/access",
    summary="Get what the credentials of this request allow",
    response_model=ClientAccess,
    responses=example_response({"scope": "admin"}) | problems(Kind.INVALID_REQUEST),
)
async def get_access(request: Request) -> Response:
    answers_of(request)  # an unknown one is refused
    scope: Scope = getattr(request.state, "scope", Scope.ADMIN)  # without authentication everybody may do all
    return json_response({"scope": scope.word})
