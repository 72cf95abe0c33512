"""The routes for poses: one tag, many tags, and the explanation of a pose."""

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from typing import Annotated, Any, Literal

from fastapi import Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.routing import APIRoute
from pydantic import BaseModel, Field
from starlette.responses import Response, StreamingResponse

from dropanchor_schemas.explain import Explanation
from dropanchor_schemas.geojson import PoseFeatureCollection, TimedPoseFeature
from dropanchor_schemas.pose import PoseList, TimedPose
from dropanchor_service.answers.answers import Answer, Answers
from dropanchor_service.answers.explain import explanation_of
from dropanchor_service.answers.pose_at_time import NoPoseThenError, TooFarAheadError
from dropanchor_service.answers.times import iso_utc
from dropanchor_service.api.formats import geojson
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.contents import schema_of
from dropanchor_service.api.routes.known_tag import known_tag
from dropanchor_service.api.routes.parameters import (
    AtTime,
    LastInnovations,
    PoseQuery,
    TagId,
    example_response,
    id_of,
    json_response,
)
from dropanchor_service.api.routes.past import OF_RUNS, explained
from dropanchor_service.api.routes.site_of_request import answers_of

PIECE_BYTES = 400_000  # larger writes are copied repeatedly while the kernel does not accept all of them

_NEGOTIATION = (Kind.NOT_ACCEPTABLE, Kind.NOT_GEOREFERENCED, Kind.INVALID_REQUEST)


_Format = Annotated[
    Literal["json", "geojson"] | None,
    Field(description="The format of the response. The default depends on the header `Accept`."),
]


class ListedPoses(PoseQuery):
    """The query of the list of poses."""

    format: _Format = None


class PoseOfTag(AtTime):
    """The query of one pose."""

    format: _Format = None


class PlainPose(APIRoute):
    """Skips FastAPI's parameter handling for a request without a query.

    Only the id of the tag has to be read then. Solving the declared parameters would take longer than the response.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        with_parameters = super().get_route_handler()
        no_query = PoseOfTag()

        async def handle(request: Request) -> Response:
            if request.scope["query_string"]:
                return await with_parameters(request)
            answer: Response = await self.endpoint(id_of(request.path_params["tag"]), no_query, request)
            return answer

        return handle


def _offers(example: Answer, as_geojson: type[BaseModel]) -> dict[int | str, dict[str, Any]]:
    features = {"schema": schema_of(as_geojson)}
    return {200: {"content": {geojson.JSON: {"example": example}, geojson.MEDIA_TYPE: features}}}


router = Router(tags=["poses"])


async def get_pose(tag: TagId, query: Annotated[PoseOfTag, Query()], request: Request) -> Response:
    answers = answers_of(request)
    as_geojson = geojson.is_preferred(request, answers, query.format)
    if query.at is None:
        pose = _pose_of(answers, tag)
    else:  # may read from disk
        pose = await run_in_threadpool(_pose_at, answers, tag, query.at)
    pose["t_utc"] = iso_utc(pose["t_ns"])
    return _response(geojson.feature_of(pose), geojson.MEDIA_TYPE) if as_geojson else _response(pose, geojson.JSON)


router.add_api_route(
    "/tags/{tag}/pose",
    get_pose,
    methods=["GET"],
    route_class_override=PlainPose,
    summary="Get the latest pose of a tag, or its pose at a time",
    response_model=TimedPose,
    responses=_offers(examples.POSE | {"t_utc": iso_utc(examples.POSE["t_ns"])}, TimedPoseFeature)
    | problems(Kind.UNKNOWN_TAG, Kind.NO_POSE_YET, Kind.NO_POSE_THEN, Kind.TOO_FAR_AHEAD, *_NEGOTIATION),
)


@router.get(
    "/tags/{tag}/explain",
    summary="Explain the latest pose of a tag, or its pose at a time",
    response_model=Explanation,
    responses=example_response(examples.EXPLANATION)
    | problems(*OF_RUNS, Kind.UNKNOWN_TAG, Kind.NO_POSE_YET, Kind.INVALID_REQUEST),
)
async def explain_pose(tag: TagId, query: Annotated[LastInnovations, Query()], request: Request) -> Response:
    answers = answers_of(request)
    if query.at is not None:
        return json_response(await explained(request, tag, query.at, query.last))
    explanation = explanation_of(answers, known_tag(answers, tag), query.last)
    if explanation is None:
        raise _no_pose_yet(answers, tag)
    return json_response(explanation)


@router.get(
    "/poses",
    summary="List the latest poses of all or selected tags",
    response_model=PoseList,
    responses=_offers(examples.POSE_LIST, PoseFeatureCollection) | problems(*_NEGOTIATION),
)
async def list_poses(query: Annotated[ListedPoses, Query()], request: Request) -> Response:
    answers = answers_of(request)
    as_geojson = geojson.is_preferred(request, answers, query.format)
    found = [tag for tag in map(answers.tags.find, query.tags) if tag is not None]
    tags = found if query.tags else None
    if as_geojson:
        return _response(geojson.collection_of(answers.pose_list(tags, query.wanted)), geojson.MEDIA_TYPE)
    headers = {"cache-control": "no-store", "vary": "accept"}
    return StreamingResponse(
        in_pieces(answers.pose_list_json(tags, query.wanted)), media_type=geojson.JSON, headers=headers
    )


async def in_pieces(chunks: Iterator[bytes | memoryview]) -> AsyncIterator[bytes | memoryview]:
    """Yield the chunks in pieces, and let other requests run between two chunks."""
    for chunk in chunks:
        for begin in range(0, len(chunk), PIECE_BYTES):
            yield chunk[begin : begin + PIECE_BYTES]
        await asyncio.sleep(0)


def _no_pose_yet(answers: Answers, name: str) -> ProblemError:
    hint = answers.hint_of(known_tag(answers, name))
    return ProblemError(
        Kind.NO_POSE_YET, f"Tag {name!r} has no pose, because no range of it has been used yet. {hint}".rstrip()
    )


def _pose_of(answers: Answers, name: str) -> Answer:
    pose = answers.pose_of(known_tag(answers, name))
    if pose is None:
        raise _no_pose_yet(answers, name)
    return pose


def _pose_at(answers: Answers, name: str, at_ns: int) -> Answer:
    try:
        pose = answers.pose_at(name, at_ns)
    except TooFarAheadError as error:
        raise ProblemError(Kind.TOO_FAR_AHEAD, f"Tag {name!r}: {error}.") from error
    except NoPoseThenError as error:
        raise ProblemError(Kind.NO_POSE_THEN, f"Tag {name!r}: {error}.") from error
    if pose is None:
        raise _no_pose_yet(answers, name)
    return pose


def _response(answer: Answer, media_type: str) -> Response:
    response = json_response(answer, media_type)
    response.headers["vary"] = "accept"
    return response
