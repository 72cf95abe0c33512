"""Tags: what was heard from them, and what an operator says about them."""

from collections.abc import Iterator
from typing import Annotated

from fastapi import APIRouter, Body
from starlette.responses import Response

from dropanchor_schemas.answers import NewcomerList, TagList, TagStatus
from dropanchor_schemas.keys import InvalidKeyError, refuse_pattern
from dropanchor_schemas.site import TagSettings
from dropanchor_service.answers.answers import Answer, Answers
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.parameters import NO_QUERY, TagId, json_response, saving, shown
from dropanchor_service.store.tags import KINDS, REASONS, Tag

_REASON_NAMES = [reason.value for reason in REASONS]


def tags_router(answers: Answers, max_tags: int) -> APIRouter:
    router = APIRouter(tags=["tags"], dependencies=[NO_QUERY])

    @router.get(
        "/tags",
        operation_id="list_tags",
        summary="All tags that have been heard or configured",
        response_model=TagList,
        responses=shown(examples.TAG_LIST) | problems(Kind.INVALID_REQUEST),
    )
    def list_tags() -> Response:
        return json_response({"t_ns": answers.now_ns(), "tags": list(_statuses(answers, answers.tags.all()))})

    @router.get(
        "/newcomers",
        operation_id="list_newcomers",
        summary="Tags that have been heard and are not admitted",
        description='With `unknown_tags = "quarantine"` they stay here until their settings are put, `{}` at least; '
        "with `accept` until they have sent a second message, where many are new at once. As many as `max_tags` are "
        "remembered, those that were heard last. A restart forgets them.",
        response_model=NewcomerList,
        responses=shown(examples.NEWCOMER_LIST) | problems(Kind.INVALID_REQUEST),
    )
    def list_newcomers() -> Response:
        newcomers = [
            {
                "tag": newcomer.name,
                "first_heard_ns": newcomer.first_heard_ns,
                "last_heard_ns": newcomer.last_heard_ns,
                "messages": newcomer.messages,
            }
            for newcomer in answers.pending_tags.all()
        ]
        return json_response({"t_ns": answers.now_ns(), "newcomers": newcomers})

    @router.get(
        "/tags/{tag}",
        operation_id="get_tag",
        summary="One tag",
        response_model=TagStatus,
        responses=shown(examples.TAG) | problems(Kind.UNKNOWN_TAG, Kind.INVALID_REQUEST),
    )
    async def get_tag(tag: TagId) -> Response:
        return json_response(next(_statuses(answers, [_known(answers, tag)])))

    @router.get(
        "/tags/{tag}/settings",
        operation_id="get_tag_settings",
        summary="The settings of a tag",
        response_model=TagSettings,
        responses=shown(examples.TAG_SETTINGS) | problems(Kind.UNKNOWN_TAG, Kind.INVALID_REQUEST),
    )
    async def get_tag_settings(tag: TagId) -> Response:
        return json_response(answers.site.tag_settings(_known(answers, tag).name).model_dump())

    @router.put(
        "/tags/{tag}/settings",
        operation_id="put_tag_settings",
        summary="Set what is known about a tag",
        description="A tag that is not known is registered. The tag's estimator starts afresh with the new settings, "
        "from `start` where it is given.",
        response_model=TagSettings,
        responses=shown(examples.TAG_SETTINGS)
        | problems(Kind.TAGS_FULL, Kind.BODY_TOO_LARGE, Kind.INVALID_REQUEST, Kind.NOT_SAVED),
    )
    def put_tag_settings(
        tag: TagId, settings: Annotated[TagSettings, Body(examples=[examples.TAG_SETTINGS])]
    ) -> Response:
        try:
            refuse_pattern(tag)
        except InvalidKeyError as error:
            raise ProblemError(Kind.INVALID_REQUEST, f"path.tag: {error}") from error
        if answers.tags.find(tag) is None and len(answers.tags) >= max_tags:
            raise ProblemError(Kind.TAGS_FULL, f"{max_tags} tags are registered, and no more are allowed.")
        with saving():
            answers.site.set_tag(tag, settings)
        answers.tags.register(tag)
        return json_response(settings.model_dump())

    return router


def _known(answers: Answers, name: str) -> Tag:
    tag = answers.tags.find(name)
    if tag is None:
        raise ProblemError(Kind.UNKNOWN_TAG, f"No tag {name!r} has been heard or configured.")
    return tag


def _statuses(answers: Answers, tags: list[Tag]) -> Iterator[Answer]:
    """`TagStatus` of each."""
    default = TagSettings().model_dump()
    configured = answers.site.tags
    for tag in tags:
        first, last, messages, samples, rejected = answers.tags.counts(tag.row).item()
        yield {
            "tag": tag.name,
            "online": tag.online,
            "first_heard_ns": first or None,
            "last_heard_ns": last or None,
            "messages": messages,
            "samples": {kind: count for kind, count in zip(KINDS, samples.tolist(), strict=True) if count},
            "rejected": {name: count for name, count in zip(_REASON_NAMES, rejected.tolist(), strict=True) if count},
            "hint": answers.hint_of(tag),
            "settings": configured[tag.name].model_dump() if tag.name in configured else default,
        }
