"""The routes that help a person to begin: simulated tags, and a QR code of a link for a phone."""

import time
from typing import Annotated

from fastapi import Body, Request
from starlette.responses import Response

from dropanchor_schemas.answers import QrCodeRequest, SimulatedTags
from dropanchor_schemas.sentences import say
from dropanchor_service.answers.connect_command import SIMULATED_ANCHOR, reachable_endpoint
from dropanchor_service.api.formats.qr_code import SVG, qr_code
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.contents import TEXT
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response, saving
from dropanchor_service.api.routes.shared_parts import shared_of
from dropanchor_service.api.routes.site_of_request import answers_of
from dropanchor_service.api.simulated_tags import simulated_settings

_SEEDS = 1000
_EXAMPLE = {"tags": 6}

router = Router(tags=["site"], dependencies=[NO_QUERY])


@router.put(
    "/simulated-tags",
    summary="Start simulated tags, in place of those that run",
    description="They drive around the first anchor, and begin where their settings then say. They end with the "
    "service, or when they are deleted. Where tags need credentials, the service starts none.",
    response_model=SimulatedTags,
    responses=example_response(_EXAMPLE)
    | problems(Kind.INVALID_REQUEST, Kind.BODY_TOO_LARGE, Kind.NOT_OFFERED, Kind.NOT_SAVED),
)
def start_simulated_tags(body: Annotated[SimulatedTags, Body(examples=[_EXAMPLE])], request: Request) -> Response:
    shared, store = shared_of(request), answers_of(request).site
    if not shared.may_simulate:
        raise ProblemError(
            Kind.NOT_OFFERED,
            say("no_simulation", "Tags need credentials here, so the service starts no simulated ones."),
        )
    seed, anchor = int(time.time()) % _SEEDS, next(iter(store.site.anchors), None)
    with saving():
        for tag, settings in simulated_settings(body.tags, seed, anchor).items():
            store.set_tag(tag, settings)
    words = ["simulate", "--until-input-ends", "--tags", str(body.tags), "--seed", str(seed), "--site", store.site.id]
    words += ["--anchor", SIMULATED_ANCHOR if anchor is None else anchor.id]
    shared.simulated.start([*words, "--connect", reachable_endpoint(shared.endpoints[0])])
    return json_response(body.model_dump())


@router.delete(
    "/simulated-tags",
    summary="Stop the simulated tags that the service runs",
    description="They stay known, as any tag that is switched off.",
    status_code=204,
    responses=problems(Kind.INVALID_REQUEST),
)
def stop_simulated_tags(request: Request) -> Response:
    shared_of(request).simulated.stop()
    return Response(status_code=204)


@router.post(
    "/qr-code",
    summary="Get the QR code of a text, such as a link that a phone opens",
    description="The text is in the body, because it may hold a key. The service keeps neither.",
    response_class=Response,
    responses=problems(Kind.INVALID_REQUEST, Kind.BODY_TOO_LARGE) | {200: {"content": {SVG: TEXT}}},
)
def make_qr_code(body: Annotated[QrCodeRequest, Body(examples=[{"text": "http://192.0.2.7:8080/tag/"}])]) -> Response:
    return Response(qr_code(body.text), media_type=SVG, headers={"cache-control": "no-store"})
