"""Health of tags that comes over HTTP: the same payload as over Zenoh."""

from typing import Annotated

from fastapi import Query, Request
from starlette.responses import Response

from dropanchor_schemas.answers import HealthReceived
from dropanchor_schemas.tag_health import decode_health
from dropanchor_schemas.wire import ENCODING_JSON, Rejection
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.ingest import OfTag, encoding_of, tag_of
from dropanchor_service.api.routes.parameters import example_response, json_response
from dropanchor_service.api.routes.site_of_request import parts_of

_BODY = {ENCODING_JSON: {"schema": {"$ref": "#/components/schemas/TagHealthMessage"}, "example": examples.HEALTH}}


router = Router(tags=["ingest"])


@router.post(
    "/ingest/health",
    summary="Report the health of a tag",
    description="Battery, temperature, firmware and more, each optional, of at most 1,024 bytes. About once a "
    "minute is enough; of more than five reports per second, the later ones are dropped.",
    status_code=202,
    response_model=HealthReceived,
    responses=example_response({"values": 4, "absurd": []}, 202)
    | problems(Kind.INVALID_REQUEST, Kind.HEALTH_REJECTED, Kind.BODY_TOO_LARGE),
    openapi_extra={"requestBody": {"required": True, "content": _BODY}},
)
async def ingest_health(request: Request, query: Annotated[OfTag, Query()]) -> Response:
    tag, payload = tag_of(request, query), await request.body()
    encoding = encoding_of(request)
    parts_of(request).receive_health(tag, payload, encoding)  # what cannot be decoded is counted there too
    report = decode_health(payload, encoding)
    if isinstance(report, Rejection):
        raise ProblemError(Kind.HEALTH_REJECTED, f"{report.reason}: {report.detail}.", reason=report.reason)
    return json_response({"values": len(report.values), "absurd": report.absurd}, status=202)
