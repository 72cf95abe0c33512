"""The routes for the app phyphox: the experiment that it loads, its QR code, and what it posts."""

import asyncio
from dataclasses import asdict
from typing import Annotated, Any

from fastapi import Query, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from dropanchor_schemas.answers import PhoneReadingsReceived
from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.wire import Reason, Rejection
from dropanchor_service.api.formats.qr_code import SVG, qr_code
from dropanchor_service.api.http.access import secret_of
from dropanchor_service.api.http.behind_proxy import prefix_of
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.contents import TEXT
from dropanchor_service.api.routes.ingest import OfApp, OfTag, tag_of, why_refused
from dropanchor_service.api.routes.parameters import example_response, json_response
from dropanchor_service.api.routes.site_of_request import ForEachSite, parts_of
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.phones.intake import PhoneIntake
from dropanchor_service.phones.phyphox import Message, parse
from dropanchor_service.phones.phyphox_experiment import AXES, COLUMNS, MEDIA_TYPE, experiment, link_of
from dropanchor_service.phones.phyphox_session import PhyphoxSession
from dropanchor_tag_client.sources.phones.readings import PhoneError, PhoneTimeError
from dropanchor_tag_client.sources.phones.session import WAIT_S

_NEVER_STORE = {"cache-control": "no-store"}  # both hold the key
_COLUMN = {"type": "array", "items": {"type": ["number", "null"]}}
_BODY = {
    "type": "object",
    "description": "One message of the experiment that the service makes for the app.",
    "required": ["time"],
    "properties": {"time": {"type": "object"}}
    | {f"{column}_{axis}": _COLUMN for column in COLUMNS.values() for axis in AXES},
}


def _phones(site: SiteParts) -> PhoneIntake[Message]:
    return PhoneIntake(site.receive, site.receive_health, parse, lambda _: PhyphoxSession())


def _file(media_type: str, description: str) -> dict[int | str, dict[str, Any]]:
    return {200: {"content": {media_type: TEXT}, "description": description}}


router = Router(tags=["ingest"])
_phones_of = ForEachSite(_phones)


@router.get(
    "/ingest/phyphox",
    summary="Get the experiment that makes the app phyphox send the motion of a tag",
    description="Open `phyphox://HOST/api/v1/ingest/phyphox?token=KEY` on the phone. The file holds the key.",
    response_class=Response,
    responses=_file(MEDIA_TYPE, "The experiment.") | problems(Kind.INVALID_REQUEST),
)
async def get_phyphox_experiment(request: Request, query: Annotated[OfApp, Query()]) -> Response:
    tag = tag_of(request, query)
    content = experiment(_address(request), tag, secret_of(request))
    named = {"content-disposition": 'attachment; filename="tag.phyphox"'}
    return Response(content, media_type=MEDIA_TYPE, headers=_NEVER_STORE | named)


@router.get(
    "/ingest/phyphox/code",
    summary="Get the QR code that the app phyphox scans to load the experiment of a tag",
    response_class=Response,
    responses=_file(SVG, "The QR code.") | problems(Kind.INVALID_REQUEST),
)
async def get_phyphox_code(request: Request, query: Annotated[OfTag, Query()]) -> Response:
    link = link_of(_address(request), tag_of(request, query), secret_of(request))
    return Response(qr_code(link), media_type=SVG, headers=_NEVER_STORE)


def _address(request: Request) -> str:
    """Return where the app sends readings, below the site if the request names one."""
    path = request.scope["path"].removesuffix("/code")
    return f"{str(request.base_url).rstrip('/')}{prefix_of(request)}{path}"


@router.post(
    "/ingest/phyphox",
    summary="Send readings of a phone with the app phyphox",
    description="The address in the experiment. Readings become IMU samples of the tag, as those of Sensor Logger "
    "do. They are put in order by their times and used once each.",
    response_model=PhoneReadingsReceived,
    responses=example_response(examples.PHONE_READINGS)
    | problems(Kind.INVALID_REQUEST, Kind.SAMPLES_REJECTED, Kind.BODY_TOO_LARGE),
    openapi_extra={"requestBody": {"required": True, "content": {"application/json": {"schema": _BODY}}}},
)
async def ingest_phyphox(request: Request, query: Annotated[OfApp, Query()]) -> Response:
    tag, phones, body = tag_of(request, query), _phones_of(request), await request.body()
    try:
        outcome = await run_in_threadpool(phones.post, tag, body)
    except PhoneTimeError as error:
        raise ProblemError(Kind.SAMPLES_REJECTED, str(error), reason=Reason.TIME_NOT_UTC) from error
    except PhoneError as error:
        counted = decode_json(body)
        reason = {"reason": counted.reason} if isinstance(counted, Rejection) else {}
        raise ProblemError(Kind.SAMPLES_REJECTED, str(error), **reason) from error
    if (refused := why_refused(parts_of(request), tag)) is not None:
        raise ProblemError(Kind.SAMPLES_REJECTED, refused.detail, reason=refused.reason)
    if outcome.waiting:
        loop = asyncio.get_running_loop()
        loop.call_later(WAIT_S, loop.run_in_executor, None, phones.release_overdue)
    return json_response(asdict(outcome))
