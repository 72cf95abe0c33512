"""The routes for tags: what they have sent, and their settings."""

from collections.abc import Iterator, Mapping
from typing import Annotated

from fastapi import Body, Query, Request
from starlette.responses import Response

from dropanchor_schemas.answers import NewcomerList, PendingTagList, TagList, TimedTagStatus
from dropanchor_schemas.keys import InvalidKeyError, refuse_pattern
from dropanchor_schemas.sentences import phrase_of, said_by, say
from dropanchor_schemas.site import TagSettings
from dropanchor_service.answers.answers import Answer, Answers
from dropanchor_service.answers.care import care_of, health_answer
from dropanchor_service.answers.times import iso_utc
from dropanchor_service.api.http.errors import Kind, ProblemError, at, problems
from dropanchor_service.api.http.etags import Conditions, etag_of
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.known_tag import known_tag
from dropanchor_service.api.routes.parameters import (
    NO_QUERY,
    TagFilter,
    TagId,
    example_response,
    json_response,
    resource_response,
    saving,
)
from dropanchor_service.api.routes.shown_to_links import shown_to
from dropanchor_service.api.routes.site_of_request import answers_of, parts_of
from dropanchor_service.store.clock_offsets import ClockOffset
from dropanchor_service.store.preconditions import Precondition
from dropanchor_service.store.tags import KINDS, REASONS, Tag

_REASON_NAMES = [reason.value for reason in REASONS]


def _timed(status: Answer) -> Answer:
    """Return the `TimedTagStatus` of a `TagStatus`."""
    times = {name: status[f"{name}_ns"] for name in ("first_heard", "last_heard")}
    return status | {f"{name}_utc": None if t_ns is None else iso_utc(t_ns) for name, t_ns in times.items()}


router_of_all = Router(tags=["tags"])


router = Router(tags=["tags"], dependencies=[NO_QUERY])


@router_of_all.get(
    "/tags",
    summary="List all tags that have sent messages or been configured",
    response_model=TagList,
    responses=example_response(examples.TAG_LIST) | problems(Kind.INVALID_REQUEST),
)
def list_tags(query: Annotated[TagFilter, Query()], request: Request) -> Response:
    answers = answers_of(request)
    now_ns = answers.now_ns()
    offsets = answers.clock_offsets.clock_offsets(now_ns)
    wanted = set(query.tags)
    tags = [tag for tag in answers.tags.listed() if not wanted or tag.name in wanted]
    show = shown_to(request)
    return json_response({"t_ns": now_ns, "tags": list(map(show, _statuses(answers, tags, offsets, now_ns)))})


@router.get(
    "/pending-tags",
    summary="List tags that have sent messages but are not admitted yet",
    description='With `unknown_tags = "quarantine"`, a tag stays in this list until you put its settings (`{}` is '
    "enough). With `accept`, a tag stays only while many tags are new at once, until its second message. The list "
    "holds up to `max_tags` tags, those that sent most recently. A restart clears it.",
    response_model=PendingTagList,
    responses=example_response(examples.PENDING_TAG_LIST) | problems(Kind.INVALID_REQUEST),
)
def list_pending_tags(request: Request) -> Response:
    answers = answers_of(request)
    return json_response({"t_ns": answers.now_ns(), "tags": _pending(answers)})


@router.get(
    "/newcomers",
    summary="The former name of /pending-tags, until the next version",
    deprecated=True,
    response_model=NewcomerList,
    responses=example_response(examples.NEWCOMER_LIST) | problems(Kind.INVALID_REQUEST),
)
def list_newcomers(request: Request) -> Response:
    answers = answers_of(request)
    return json_response({"t_ns": answers.now_ns(), "newcomers": _pending(answers)})


@router.get(
    "/tags/{tag}",
    summary="Get a tag",
    response_model=TimedTagStatus,
    responses=example_response(_timed(examples.TAG)) | problems(Kind.UNKNOWN_TAG, Kind.INVALID_REQUEST),
)
async def get_tag(tag: TagId, request: Request) -> Response:
    answers = answers_of(request)
    known, now_ns = known_tag(answers, tag), answers.now_ns()
    offset = answers.clock_offsets.clock_offset(known.row, now_ns)
    status = next(_statuses(answers, [known], {known.row: offset}, now_ns))
    return json_response(_timed(shown_to(request)(status)))


@router.get(
    "/tags/{tag}/settings",
    summary="Get the settings of a tag",
    response_model=TagSettings,
    responses=example_response(examples.TAG_SETTINGS) | problems(Kind.UNKNOWN_TAG, Kind.INVALID_REQUEST),
)
async def get_tag_settings(tag: TagId, request: Request) -> Response:
    answers = answers_of(request)
    return resource_response(answers.site.tag_settings(known_tag(answers, tag).name))


@router.put(
    "/tags/{tag}/settings",
    summary="Replace the settings of a tag",
    description="An unknown tag is registered. What the body leaves out is as in `tag_defaults` of the service's "
    "settings. The estimator of the tag restarts with the new settings, from "
    "`start` if it is given, unless only `name`, `colour` and `group` have changed.",
    response_model=TagSettings,
    responses=example_response(examples.TAG_SETTINGS)
    | problems(Kind.TAGS_FULL, Kind.CHANGED_MEANWHILE, Kind.BODY_TOO_LARGE, Kind.INVALID_REQUEST, Kind.NOT_SAVED),
)
def put_tag_settings(
    tag: TagId,
    settings: Annotated[TagSettings, Body(examples=[examples.TAG_SETTINGS])],
    allows: Conditions,
    request: Request,
) -> Response:
    parts = parts_of(request)
    answers = parts.answers
    register_tag(answers, tag, settings, parts.max_tags, allows)
    return resource_response(answers.site.tag_settings(tag))


@router.delete(
    "/tags/{tag}",
    summary="Delete a tag: its settings, its counters and its pose",
    description="Its stored tracks stay. A tag that still sends is unknown from then on. With "
    '`unknown_tags = "accept"`, it is back with its next message, with the settings in `tag_defaults`. The `ETag` '
    "of the answer is that of those settings: as the `If-Match` of a `PUT` of the settings, it undoes the deletion "
    "unless somebody has set others since.",
    status_code=204,
    responses=problems(Kind.UNKNOWN_TAG, Kind.CHANGED_MEANWHILE, Kind.INVALID_REQUEST, Kind.NOT_SAVED),
)
def delete_tag(tag: TagId, allows: Conditions, request: Request) -> Response:
    answers = answers_of(request)
    known = known_tag(answers, tag)
    with saving():
        answers.site.remove_tag(known.name, answers.now_ns(), allows)
    answers.forget(known)
    return Response(status_code=204, headers={"etag": etag_of(answers.site.tag_settings(tag))})


def register_tag(answers: Answers, tag: str, settings: TagSettings, max_tags: int, allows: Precondition) -> None:
    """Store the settings of a tag, and register it if it is unknown. Raises ProblemError."""
    try:
        refuse_pattern(tag)
    except InvalidKeyError as error:
        raise ProblemError(Kind.INVALID_REQUEST, at("path.tag", said_by(error))) from error
    if answers.tags.find(tag) is None and len(answers.tags) >= max_tags:
        raise ProblemError(
            Kind.TAGS_FULL,
            say("tags_full", "{n} tags are registered already. Raise `max_tags` to allow more.", n=max_tags),
        )
    with saving():
        answers.site.set_tag(tag, settings, allows)
    answers.tags.register(tag)


def remote_answer(answers: Answers, tag: Tag) -> Answer:
    """Return the `RemoteSettingsStatus` of a tag."""
    health = answers.health.of(tag.row)
    return {
        "wanted": answers.site.remote_settings(tag.name).model_dump(),
        "acknowledged": None if health is None else health.values.get("settings"),
    }


def _pending(answers: Answers) -> list[Answer]:
    """Return the `PendingTag` of each tag that waits."""
    return [
        {
            "tag": tag.name,
            "first_heard_ns": tag.first_heard_ns,
            "last_heard_ns": tag.last_heard_ns,
            "messages": tag.messages,
        }
        for tag in answers.pending_tags.all()
    ]


def _statuses(
    answers: Answers, tags: list[Tag], offsets: Mapping[int, ClockOffset | None], now_ns: int
) -> Iterator[Answer]:
    """Yield the `TagStatus` of each tag. offsets: between its clocks, by row."""
    default = answers.site.default_settings.model_dump()
    configured = answers.site.tags
    for tag in tags:
        offset = offsets.get(tag.row)
        first, last, messages, samples, rejected, *_ = answers.tags.rows.counts(tag.row).item()
        yield {
            "tag": tag.name,
            "online": tag.online,
            "first_heard_ns": first or None,
            "last_heard_ns": last or None,
            "messages": messages,
            "samples": {kind: count for kind, count in zip(KINDS, samples.tolist(), strict=True) if count},
            "arrived": dict(tag.arrived),
            "used": dict(tag.used),
            "rejected": {name: count for name, count in zip(_REASON_NAMES, rejected.tolist(), strict=True) if count},
            "lag_s": float(answers.tags.rows.lag_s(tag.row)),
            "hint": (hint := answers.hint_of(tag)),
            "hint_phrase": phrase_of(hint),
            "unknown_anchor": answers.unknown_anchor_of(tag),
            "health": health_answer(answers.health.of(tag.row), now_ns),
            "clock_offset": None if offset is None else offset.answer(),
            "clock_error_s": tag.rows.clock_errors.get(tag.row),
            "needs_care": care_of(tag, answers.health, now_ns, offset),
            "remote_settings": remote_answer(answers, tag),
            "settings": configured[tag.name].model_dump() if tag.name in configured else default,
        }
