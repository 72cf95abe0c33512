"""What the service sets in the programs of tags: batch period and rates."""

from typing import Annotated, Any

from fastapi import Body, Header, Request
from pydantic import ValidationError
from starlette.responses import Response

from dropanchor_schemas.answers import RemoteSettingsStatus
from dropanchor_schemas.site import RemoteSettings
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.etags import etag_of, matches
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.known_tag import known_tag
from dropanchor_service.api.routes.parameters import NO_QUERY, TagId, example_response, json_response, saving
from dropanchor_service.api.routes.site_of_request import answers_of
from dropanchor_service.api.routes.tags import remote_answer
from dropanchor_service.store import Tag

_PATCH = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {
                "schema": {"$ref": "#/components/schemas/RemoteSettings"},
                "example": {"batch_s": 0.5},
            }
        },
    }
}


router = Router(tags=["tags"], dependencies=[NO_QUERY])


@router.get(
    "/tags/{tag}/remote-settings",
    summary="Get what is set in the program of a tag, and what the program applies",
    response_model=RemoteSettingsStatus,
    responses=example_response(examples.REMOTE_SETTINGS) | problems(Kind.UNKNOWN_TAG, Kind.INVALID_REQUEST),
)
async def get_remote_settings(tag: TagId, request: Request) -> Response:
    answers = answers_of(request)
    return _response(answers, known_tag(answers, tag))


@router.patch(
    "/tags/{tag}/remote-settings",
    summary="Set values in the program of a tag",
    description="The values in the body replace the current ones, the others stay; null leaves a value to the "
    "program. The program gets them over Zenoh at once, or when it is connected. With `If-Match`, nothing changes "
    "unless it is the `ETag` of the current values.",
    response_model=RemoteSettingsStatus,
    responses=example_response(examples.REMOTE_SETTINGS)
    | problems(Kind.UNKNOWN_TAG, Kind.CHANGED_MEANWHILE, Kind.BODY_TOO_LARGE, Kind.INVALID_REQUEST, Kind.NOT_SAVED),
    openapi_extra=_PATCH,
)
def patch_remote_settings(
    tag: TagId,
    patch: Annotated[dict[str, Any], Body()],
    request: Request,
    if_match: Annotated[str | None, Header()] = None,
) -> Response:
    answers = answers_of(request)
    known = known_tag(answers, tag)
    _change(answers, known, patch, if_match)
    return _response(answers, known)


def _change(answers: Answers, tag: Tag, patch: dict[str, Any], if_match: str | None) -> None:
    """Replace the values in the patch, unless the current ones differ from `if_match`. Raises ProblemError."""
    current = answers.site.remote_settings(tag.name)
    wanted = _patched(current, patch)
    is_expected = matches(if_match, current)
    with saving():
        if not is_expected or not answers.site.set_remote(tag.name, wanted, expected=current):
            raise ProblemError(Kind.CHANGED_MEANWHILE, "Somebody changed the settings: get them and try again.")


def _patched(current: RemoteSettings, patch: dict[str, Any]) -> RemoteSettings:
    """Return the settings with the values of the patch. Raises ProblemError."""
    try:
        return RemoteSettings.model_validate(current.model_dump() | patch)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        where = ".".join(("body", *map(str, first["loc"])))
        raise ProblemError(Kind.INVALID_REQUEST, f"{where}: {first['msg']}") from error


def _response(answers: Answers, tag: Tag) -> Response:
    response = json_response(remote_answer(answers, tag))
    response.headers["etag"] = etag_of(answers.site.remote_settings(tag.name))
    return response
