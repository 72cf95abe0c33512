"""Samples that come over HTTP: the same payloads as over Zenoh, and what the app Sensor Logger pushes."""

import asyncio
from dataclasses import asdict
from typing import Annotated

from fastapi import Query, Request
from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.responses import PlainTextResponse, Response

from dropanchor_schemas.answers import PhoneReadingsReceived, SamplesReceived
from dropanchor_schemas.keys import InvalidKeyError, chunk_from_id
from dropanchor_schemas.kinds import KINDS, Frame
from dropanchor_schemas.models import Exact
from dropanchor_schemas.rejections import REASONS_EXPLAINED
from dropanchor_schemas.samples import decode_json
from dropanchor_schemas.site import ID_SCHEMA
from dropanchor_schemas.times import why_not_utc
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Reason, Rejection, read_header
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.contents import BYTES, TEXT
from dropanchor_service.api.routes.parameters import example_response, json_response
from dropanchor_service.api.routes.site_of_request import ForEachSite, parts_of
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.phones.intake import PhoneIntake
from dropanchor_tag_client.sources.phones.pairing import Signs
from dropanchor_tag_client.sources.phones.readings import PhoneError
from dropanchor_tag_client.sources.phones.sensor_logger import Message, parse
from dropanchor_tag_client.sources.phones.session import WAIT_S, Session

PHONE_ERROR = 499
"""The one status of which Sensor Logger shows the text."""

_SENSOR_LOGGER_BODY = {
    "type": "object",
    "description": "One message of the app's HTTP Push.",
    "properties": {
        "messageId": {"type": "integer", "minimum": 0, "maximum": 2**53 - 1},
        "sessionId": {"type": "string", "minLength": 1, "maxLength": 128},
        "deviceId": {"type": "string"},
        "payload": {"type": "array", "items": {"type": "object"}},
    },
}
_SAMPLES_BODY = {
    ENCODING_JSON: {"schema": {"$ref": "#/components/schemas/SamplesMessage"}, "example": examples.SAMPLES},
    ENCODING_PACKED: BYTES,
}


class OfTag(Exact):
    """The query of a route that takes samples."""

    tag: str | None = Field(
        default=None,
        description="The tag's id. Needed without credentials; a tag's key speaks for its own tag only.",
        examples=["tag-1"],
        json_schema_extra=ID_SCHEMA,
    )


class OfApp(OfTag):
    """The query of a route for a phone's app."""

    token: str | None = Field(default=None, description="The tag's key, where the app cannot set a header.")


class OfSensorLogger(OfApp):
    """The query of the route for Sensor Logger."""

    signs: Signs = Field(
        default=Signs.AUTO,
        description="Which way accelerations point: as on Android or, without standardised units and frames, on iOS; "
        "auto: total acceleration is Android's, else gravity tells while the screen is up.",
    )


def _phones(site: SiteParts) -> PhoneIntake[Message]:
    return PhoneIntake(site.receive, site.receive_health, parse, Session)


router = Router(tags=["ingest"])
_phones_of = ForEachSite(_phones)
_PHONE_ERROR = {"description": "A sentence that the app shows.", "content": {"text/plain": TEXT}}


def encoding_of(request: Request) -> str:
    """Return the media type of the body, without its parameters."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


@router.post(
    "/ingest/samples",
    summary="Send samples of a tag",
    description="One payload of the contract, chosen by Content-Type as over Zenoh by the encoding, of at most "
    "65,536 bytes; the body may be packed (Content-Encoding: gzip or deflate). It is treated as if it had come "
    "over Zenoh: order, clocks, admission and counters are the same. "
    "Times before 2015 that do not count from boot are refused: they are not UTC in ns. So is a tag that the site "
    "does not admit (`unknown_tags`).",
    status_code=202,
    response_model=SamplesReceived,
    responses=example_response({"samples": 1}, 202)
    | problems(Kind.INVALID_REQUEST, Kind.SAMPLES_REJECTED, Kind.BODY_TOO_LARGE, Kind.UNKNOWN_CONTENT_ENCODING),
    openapi_extra={"requestBody": {"required": True, "content": _SAMPLES_BODY}},
)
async def ingest_samples(request: Request, query: Annotated[OfTag, Query()]) -> Response:
    tag, payload = tag_of(request, query), await request.body()
    encoding = encoding_of(request)
    samples = take_samples(parts_of(request), tag, payload, encoding)
    if isinstance(samples, Rejection):
        raise ProblemError(Kind.SAMPLES_REJECTED, f"{samples.reason}: {samples.detail}.", reason=samples.reason)
    return json_response({"samples": samples}, status=202)


@router.post(
    "/ingest/sensor-logger",
    summary="Send readings of a phone with the app Sensor Logger",
    description="The address for the app's HTTP Push. Readings become IMU samples of the tag: at the times of the "
    "gyroscope, x to the top edge of the phone. Messages are put in order and used once each.",
    response_model=PhoneReadingsReceived,
    responses=example_response(examples.PHONE_READINGS)
    | problems(Kind.INVALID_REQUEST, Kind.BODY_TOO_LARGE)
    | {PHONE_ERROR: _PHONE_ERROR},
    openapi_extra={"requestBody": {"required": True, "content": {"application/json": {"schema": _SENSOR_LOGGER_BODY}}}},
)
async def ingest_sensor_logger(request: Request, query: Annotated[OfSensorLogger, Query()]) -> Response:
    tag, phones, body = tag_of(request, query), _phones_of(request), await request.body()
    try:
        posted = await run_in_threadpool(phones.post, tag, body, query.signs)
    except PhoneError as error:
        return PlainTextResponse(str(error), PHONE_ERROR)
    if (refused := why_refused(parts_of(request), tag)) is not None:
        return PlainTextResponse(refused.detail, PHONE_ERROR)
    if posted.waiting:
        loop = asyncio.get_running_loop()
        loop.call_later(WAIT_S, loop.run_in_executor, None, phones.release_overdue)
    return json_response(asdict(posted))


def tag_of(request: Request, query: OfTag) -> str:
    """Return the tag that a request speaks for: that of its key, or without credentials the one it names."""
    own: str | None = getattr(request.state, "tag", None)
    if own is not None and query.tag not in (None, own):
        raise ProblemError(Kind.FORBIDDEN, f"This key speaks for the tag {own!r} only.")
    tag = own or query.tag
    if tag is None:
        raise ProblemError(Kind.INVALID_REQUEST, "query.tag: say which tag this is: add ?tag=NAME to the URL")
    try:
        chunk_from_id(tag)
    except InvalidKeyError as error:
        raise ProblemError(Kind.INVALID_REQUEST, f"query.tag: {error}") from error
    return tag


def take_samples(site: SiteParts, tag: str, payload: bytes, encoding: str) -> int | Rejection:
    """Take a payload in. Return how many samples it holds, or why none of them is used."""
    site.receive(tag, payload, encoding)  # what is refused is counted there, too
    found = count_samples(payload, encoding)
    return found if isinstance(found, Rejection) else why_refused(site, tag) or found


def why_refused(site: SiteParts, tag: str) -> Rejection | None:
    """Return why the site refuses all samples of a tag, None if it does not."""
    reason = site.refusal_of(tag)
    return None if reason is None else Rejection(reason, REASONS_EXPLAINED[reason].cause)


def count_samples(payload: bytes, encoding: str) -> int | Rejection:
    """Return how many samples a payload holds, or why it cannot be decoded or has times that cannot be UTC."""
    if encoding == ENCODING_PACKED:
        header = read_header(payload)
        if isinstance(header, Rejection):
            return header
        flags, counts, _, _, t0_ns = header
        wrong = None if flags else why_not_utc(t0_ns)  # both flags allow other times
        return sum(counts) if wrong is None else Rejection(Reason.TIME_NOT_UTC, wrong)
    if encoding == ENCODING_JSON:
        frame = decode_json(payload)
        if isinstance(frame, Rejection):
            return frame
        return _wrong_time(frame) or len(frame)
    return Rejection(Reason.ENCODING_UNKNOWN, f"the Content-Type is neither {ENCODING_JSON} nor {ENCODING_PACKED}")


def _wrong_time(frame: Frame) -> Rejection | None:
    """Return why the first sample whose time cannot be UTC is refused, None without one."""
    if frame.boot_clock or frame.replay:
        return None
    named = ((f"{kind.name}.{at}", sample) for kind in KINDS for at, sample in enumerate(getattr(frame, kind.field)))
    found = ((place, why_not_utc(sample.t_ns)) for place, sample in named)
    return next((Rejection(Reason.TIME_NOT_UTC, f"{place}: {why}") for place, why in found if why), None)
