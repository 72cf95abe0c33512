"""The routes that ask the black box: explain a pose of the past, get raw samples, and run minutes again."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal
from urllib.parse import quote

import orjson
from fastapi import Body, Query, Request
from fastapi.concurrency import run_in_threadpool
from pydantic import Field
from starlette.responses import Response, StreamingResponse

from dropanchor_schemas.past import WhatIf, WhatIfAnswer
from dropanchor_schemas.sentences import Sentence, said_by, say
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.permissions import Need
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import past_examples as examples
from dropanchor_service.api.routes.contents import BYTES, TEXT
from dropanchor_service.api.routes.known_tag import known_tag
from dropanchor_service.api.routes.parameters import NO_QUERY, TagId, example_response, json_response
from dropanchor_service.api.routes.period import HOUR_NS, Period, limits_of
from dropanchor_service.api.routes.site_of_request import answers_of, parts_of
from dropanchor_service.blackbox.box import BlackBox
from dropanchor_service.blackbox.chosen import BoxError
from dropanchor_service.blackbox.export import Sent
from dropanchor_service.blackbox.questions import Question

MOST_WAITING = 4  # questions; the estimators come first
WRITTEN_S = 5.0
OF_THE_BOX = (Kind.NO_BLACK_BOX, Kind.NOT_IN_BLACK_BOX)
OF_RUNS = (*OF_THE_BOX, Kind.PAST_FAILED, Kind.BUSY)

router = Router(tags=["past"])


class SamplesQuery(Period):
    """The minutes to get, and how."""

    format: Literal["mcap", "csv"] = Field(
        default="mcap", description="A recording, which `dropanchor replay` runs again, or a table of all samples."
    )
    anonymous: bool = Field(
        default=False, description="Leave out the names of the tag and of the site, its group and where on Earth it is."
    )


@router.get(
    "/tags/{tag}/samples",
    summary="Get the raw samples that a tag sent in some minutes",
    description="They come from the black box, which holds the last hours. A request gets one hour at most; without "
    "`from` it is the hour before `to`. The table has SI units, and times as the tag sent them.",
    response_class=StreamingResponse,
    responses=problems(*OF_THE_BOX, Kind.UNKNOWN_TAG, Kind.INVALID_REQUEST)
    | {200: {"content": {"application/octet-stream": BYTES, "text/csv": TEXT}}},
)
def get_samples(tag: TagId, query: Annotated[SamplesQuery, Query()], request: Request) -> StreamingResponse:
    answers, box = answers_of(request), _box(request)
    known_tag(answers, tag)
    from_ns, to_ns = limits_of(query, answers.now_ns())
    if to_ns - from_ns > HOUR_NS:
        raise ProblemError(Kind.INVALID_REQUEST, say("past_hour", "query.from: is more than an hour before `to`"))
    if answers.now_ns() - to_ns < 60e9:
        box.write_now(WRITTEN_S)
    try:
        sent = Sent(box.folder, answers.site.site.id, tag, from_ns, to_ns, query.anonymous)
    except BoxError as error:
        raise ProblemError(Kind.NOT_IN_BLACK_BOX, said_by(error)) from error
    content: Iterator[bytes] = sent.mcap() if query.format == "mcap" else sent.table()
    media_type = "application/octet-stream" if query.format == "mcap" else "text/csv"
    name = quote(f"{sent.name}.{query.format}", safe="")
    headers = {"cache-control": "no-store", "content-disposition": f"attachment; filename*=UTF-8''{name}"}
    return StreamingResponse(content, media_type=media_type, headers=headers)


@router.post(
    "/tags/{tag}/what-if",
    summary="Run some minutes of a tag again, with other settings",
    description="Nothing changes: another process runs what the black box holds. The tag goes on from where it was at "
    "`from_ns`, and changes of its settings after that do not count.",
    response_model=WhatIfAnswer,
    responses=example_response(examples.WHAT_IF_ANSWER)
    | problems(*OF_RUNS, Kind.UNKNOWN_TAG, Kind.BODY_TOO_LARGE, Kind.INVALID_REQUEST),
    dependencies=[NO_QUERY],
)
async def run_again(
    tag: TagId, what: Annotated[WhatIf, Body(examples=[examples.WHAT_IF])], request: Request
) -> Response:
    answers = answers_of(request)
    known_tag(answers, tag)
    return json_response(await answered(request, tag, what.to_ns, what_if=what))


async def explained(request: Request, tag: str, at_ns: int, last: int) -> dict[str, Any]:
    """Return the `Explanation` of a tag at a time. Raises ProblemError."""
    if getattr(request.state, "has", Need.ADMIN) < Need.READ:
        raise ProblemError(Kind.FORBIDDEN, say("past_link", "A share link explains the latest pose only."))
    known_tag(answers_of(request), tag)
    return await answered(request, tag, at_ns, at_ns=at_ns, last=last)


async def answered(request: Request, tag: str, newest_ns: int, **asked: Any) -> dict[str, Any]:
    """Return the answer of a run. newest_ns: the latest time that it needs. Raises ProblemError."""
    box, answers = _box(request), answers_of(request)
    now_ns = answers.now_ns()
    if newest_ns > now_ns:
        raise ProblemError(Kind.NOT_IN_BLACK_BOX, say("box_future", "That time has not come yet."))
    if box.runs.waiting >= MOST_WAITING:
        raise ProblemError(Kind.BUSY, say("past_busy", "Others look at the past now. Try again in a few seconds."))
    if now_ns - newest_ns < 60e9:
        await run_in_threadpool(box.write_now, WRITTEN_S)
    question = Question(folder=box.folder, site=answers.site.site.id, tag=tag, **asked)
    output = await box.runs.answer(question.model_dump_json(exclude_unset=True).encode())
    if output is None:
        raise ProblemError(Kind.PAST_FAILED, say("past_failed", "The run failed or took too long; the log says why."))
    found: dict[str, Any] = orjson.loads(output)
    if "problem" in found:
        phrase = found["phrase"]
        text = found["problem"]
        raise ProblemError(Kind.NOT_IN_BLACK_BOX, Sentence(text, **phrase) if phrase else text)
    answer: dict[str, Any] = found["answer"]
    return answer


def _box(request: Request) -> BlackBox:
    box = parts_of(request).box
    if box is None:
        sentence = say("no_box", "The service keeps no black box: set `data_dir`, and `blackbox.enabled` to true.")
        raise ProblemError(Kind.NO_BLACK_BOX, sentence)
    return box
