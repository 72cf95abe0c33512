"""Errors as problem documents (RFC 9457, application/problem+json) with stable types."""

import json
from collections.abc import Iterable, Mapping
from enum import Enum
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import Match

from dropanchor_schemas.sentences import Sentence, phrase_of, said_by, say
from dropanchor_service.api.http.site_in_path import is_omlox, knows_no_422

MEDIA_TYPE = "application/problem+json"
TYPE_PREFIX = "urn:dropanchor:problem:"

_METHODS = ("DELETE", "GET", "HEAD", "PATCH", "POST", "PUT")
_MAX_PARTS = 20
_MAX_LOCATION = 200


class Kind(Enum):
    """The kinds of problem, each with its HTTP status and title."""

    UNAUTHENTICATED = (401, "The request has no valid credentials")
    FORBIDDEN = (403, "The credentials do not allow this request")
    OTHER_ORIGIN = (403, "A web page of another origin may not do this")
    NOT_FOUND = (404, "There is no resource at this path")
    UNKNOWN_SITE = (404, "The site is unknown")
    SEVERAL_SITES = (404, "The service has several sites")
    UNKNOWN_TAG = (404, "The tag is unknown")
    NO_POSE_YET = (404, "The tag has no pose yet")
    NO_POSE_THEN = (404, "The tag has no pose at that time")
    NOT_IN_BLACK_BOX = (404, "The black box does not hold this")
    UNKNOWN_ANCHOR = (404, "The anchor is unknown")
    UNKNOWN_ZONE = (404, "The zone is unknown")
    UNKNOWN_RULE = (404, "The rule is unknown")
    UNKNOWN_ALARM = (404, "The alarm is unknown")
    UNKNOWN_SHARE = (404, "The share link is unknown")
    UNKNOWN_KEY = (404, "The API key is unknown")
    UNKNOWN_DESTINATION = (404, "The destination is unknown")
    UNKNOWN_NETWORK = (404, "The network is not among those that the page allows")
    UNKNOWN_PLAN = (404, "The floor plan is unknown")
    UNKNOWN_PLAN_IMAGE = (404, "The image of a floor plan is unknown")
    UNKNOWN_TRACKABLE = (404, "The trackable is unknown")
    UNKNOWN_FENCE = (404, "The fence is unknown")
    NO_LOCATION = (404, "The place is not known")
    NOT_OFFERED = (403, "The service does not offer this")
    METHOD_NOT_ALLOWED = (405, "The resource does not allow this method")
    NOT_ACCEPTABLE = (406, "The service offers none of the accepted media types")
    UNKNOWN_RECORDING = (404, "The recording does not exist")
    NO_BASEMAP = (409, "The service has no base map")
    NO_BLACK_BOX = (409, "The service keeps no black box")
    NO_HISTORY = (409, "The service stores no history")
    NO_ACCESS_CONTROL = (409, "The service has no access control")
    NO_RECORDER = (409, "The service cannot record")
    RECORDS_ALREADY = (409, "A recording is running already")
    RECORDS_NOTHING = (409, "No recording is running")
    RECORDING_UNFINISHED = (409, "The recording is not finished yet")
    NOT_INSTALLED = (409, "The service lacks an optional package")
    TOO_FAR_AHEAD = (409, "The time is too far ahead of the newest pose")
    NOT_GEOREFERENCED = (409, "The site has no georeference")
    SITE_ID_FIXED = (409, "The site's id cannot change while the service runs")
    ANCHOR_ID_DIFFERS = (409, "The id in the body differs from the id in the path")
    ID_DIFFERS = (409, "The id in the body is not the one in the path")
    EXISTS_ALREADY = (409, "There is a resource with this id already")
    STANDS_FOR_A_TAG = (409, "The trackable stands for a tag")
    PROVIDER_ASSIGNED = (409, "Another trackable carries the location provider")
    ITEMS_FULL = (409, "There are as many of these resources as the service allows")
    TAGS_FULL = (409, "The service has reached its limit of tags")
    IMAGE_NOT_UPLOADED = (409, "The image of the floor plan has not been uploaded")
    CHANGED_MEANWHILE = (412, "The resource is not the expected one")
    BODY_TOO_LARGE = (413, "The request body is too large")
    UNKNOWN_CONTENT_ENCODING = (415, "The request body is packed in a way that the service does not read")
    OTHER_HOST = (421, "The service does not have this name")
    INVALID_REQUEST = (422, "The request is not valid")
    SHAPE_REFUSED = (422, "The shape cannot be a zone")
    DESTINATION_REFUSED = (422, "The destination cannot be used")
    PLAN_IMAGE_REFUSED = (422, "The file cannot be a floor plan")
    SAMPLES_REJECTED = (422, "The samples are not used")
    HEALTH_REJECTED = (422, "The health of the tag cannot be decoded")
    TOO_MANY_REQUESTS = (429, "Too many requests")
    INTERNAL = (500, "An internal error occurred")
    NOT_SAVED = (503, "The change could not be saved")
    EVENTS_UNREADABLE = (503, "The events cannot be read")
    BASEMAP_UNREADABLE = (503, "The tile of the base map cannot be read")
    HISTORY_UNREADABLE = (503, "The history cannot be read")
    PAST_FAILED = (503, "The past could not be run again")
    NOT_READY = (503, "The service is not ready")
    BUSY = (503, "The service has too many open requests")
    OTHER = (400, "The request failed")

    def __init__(self, status: int, title: str) -> None:
        self.status = status
        self.title = title

    @property
    def type(self) -> str:
        return TYPE_PREFIX + self.name.lower().replace("_", "-")


class ProblemError(HTTPException):
    """An error of a route, returned to the client as a problem. members: extension members of the problem."""

    def __init__(self, kind: Kind, detail: str, **members: Any) -> None:
        super().__init__(kind.status, detail)
        self.kind = kind
        self.members = members


def problem_response(
    request: Request,
    kind: Kind,
    detail: str,
    *,
    members: Mapping[str, Any] | None = None,
    status: int | None = None,
    headers: Mapping[str, str] | None = None,
) -> Response:
    """Return a problem of this kind. status: overrides the status of the kind. members: extension members."""
    status = kind.status if status is None else status
    path, phrase = _path(request), phrase_of(detail)
    if kind in (Kind.NOT_READY, Kind.BUSY):
        headers = {"retry-after": "1", **(headers or {})}
    status = 400 if status == 422 and knows_no_422(path) else status
    if is_omlox(path):
        members = {"code": status, "message": detail} | dict(members or {})
    elif phrase is not None:
        members = {"detail_phrase": phrase} | dict(members or {})
    problem = {"type": kind.type, "title": kind.title, "status": status, "detail": detail, "instance": path}
    # ASCII: a request may hold lone surrogates, which UTF-8 cannot encode.
    body = json.dumps(problem | dict(members or {}), ensure_ascii=True).encode()
    return Response(body, status, {"cache-control": "no-store", **(headers or {})}, MEDIA_TYPE)


def at(place: str, text: str) -> str:
    """Return a sentence about a part of the request. place: as in `InvalidPart`."""
    return say("at", "{place}: {what}", place=place, what=text)


def add_error_handlers(app: FastAPI) -> None:
    app.add_exception_handler(HTTPException, _on_http_exception)
    app.add_exception_handler(RequestValidationError, _on_invalid_request)
    app.add_exception_handler(Exception, _on_exception)


def problems(*kinds: Kind) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI responses of a route that can fail with these kinds."""
    content = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    by_status: dict[int | str, dict[str, Any]] = {}
    for kind in kinds:
        earlier = by_status.get(kind.status, {}).get("description")
        line = f"`{kind.type}`: {kind.title}."
        by_status[kind.status] = {"description": f"{earlier} {line}" if earlier else line, "content": content}
    return by_status


async def _on_http_exception(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    if isinstance(error, ProblemError):
        return problem_response(request, error.kind, error.detail, members=error.members)
    match error.status_code:
        case 404:
            return problem_response(
                request, Kind.NOT_FOUND, say("no_resource", "There is no resource at {path}.", path=_path(request))
            )
        case 405:
            allow = ", ".join(_allowed_methods(request))
            detail = say(
                "no_method",
                "This resource does not allow {method}. It allows {allowed}.",
                method=request.method,
                allowed=allow,
            )
            return problem_response(request, Kind.METHOD_NOT_ALLOWED, detail, headers={"allow": allow})
        case 400:
            return problem_response(request, Kind.INVALID_REQUEST, say("no_json", "The body cannot be read as JSON."))
    headers = dict(error.headers or {})
    return problem_response(request, Kind.OTHER, str(error.detail), status=error.status_code, headers=headers)


async def _on_invalid_request(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    parts = [
        # Never repeat the input: it may be a secret, or a number that JSON cannot express.
        {"location": _location(part["loc"]), "detail": (text := message_of(part)), "detail_phrase": phrase_of(text)}
        for part in error.errors()[:_MAX_PARTS]
    ]
    detail = "; ".join(f"{part['location']}: {part['detail']}" for part in parts[:3])
    return problem_response(request, Kind.INVALID_REQUEST, detail, members={"errors": parts})


async def _on_exception(request: Request, error: Exception) -> Response:  # noqa: ARG001 - the server logs it
    return problem_response(
        request, Kind.INTERNAL, say("internal", "An unexpected error occurred. The log of the service has the details.")
    )


def _path(request: Request) -> str:
    """Return the path as the client sent it."""
    return str(request.scope.get("raw_path", b"").decode("latin-1"))


def _location(parts: Iterable[Any]) -> str:
    return ".".join(str(part) for part in parts)[:_MAX_LOCATION]


def message_of(part: Mapping[str, Any]) -> str:
    """Return what is wrong with a part of a request. part: an error of Pydantic."""
    if part["type"] == "json_invalid":
        return say("not_json", "is not JSON: {why}", why=part["ctx"]["error"])
    if part["type"] == "extra_forbidden":
        return say("unknown_field", "is unknown")
    if part["type"] == "value_error":
        return said_by(part["ctx"]["error"])
    return Sentence(
        part["msg"], f"invalid.{part['type']}", {name: _text(value) for name, value in part.get("ctx", {}).items()}
    )


def _text(value: object) -> str:
    return f"{value:.15g}" if isinstance(value, float) else str(value)


def _allowed_methods(request: Request) -> list[str]:
    """Return the methods of all routes with this path."""
    scope = {"type": "http", "path": request.scope["path"], "root_path": "", "headers": []}
    routes = request.app.router.routes
    return [
        method
        for method in _METHODS
        if any(route.matches(scope | {"method": method})[0] is Match.FULL for route in routes)
    ]
