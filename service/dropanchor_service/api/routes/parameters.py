"""What the routes share: ids in paths, filters in queries, JSON answers."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any
from urllib.parse import unquote

from fastapi import Depends, Path, Request
from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from starlette.responses import Response

from dropanchor_schemas.keys import InvalidKeyError, chunk_from_id
from dropanchor_schemas.site import ID_SCHEMA
from dropanchor_service.answers.answers import to_json
from dropanchor_service.api.http.errors import Kind, ProblemError


def json_response(answer: Any, media_type: str = "application/json", status: int = 200) -> Response:
    return Response(to_json(answer), status, media_type=media_type, headers={"cache-control": "no-store"})


async def refuse_query(request: Request) -> None:
    """For routes without query parameters: a misspelt one must not look as if it had worked."""
    if request.query_params:
        name = next(iter(request.query_params))
        raise ProblemError(Kind.INVALID_REQUEST, f"query.{name[:64]}: is not known; no query parameter is taken here")


def shown(example: Any, status: int = 200) -> dict[int | str, dict[str, Any]]:
    """How a route declares what it answers."""
    return {status: {"content": {"application/json": {"example": example}}}}


NO_QUERY = Depends(refuse_query)


def id_of(escaped: str) -> str:
    """The id of a path segment, which arrives escaped so that an id may hold a slash. Raises ProblemError."""
    try:
        identifier = unquote(escaped, errors="strict")
        chunk_from_id(identifier)
    except UnicodeDecodeError as error:
        raise ProblemError(Kind.INVALID_REQUEST, "the id in the path is not percent-escaped UTF-8") from error
    except InvalidKeyError as error:
        raise ProblemError(Kind.INVALID_REQUEST, f"the id in the path cannot be used: {error}") from error
    return identifier


async def _tag_id(
    tag: Annotated[
        str, Path(description="The tag's id, percent-escaped.", examples=["tag-1"], json_schema_extra=ID_SCHEMA)
    ],
) -> str:
    return id_of(tag)


async def _anchor_id(
    anchor: Annotated[
        str, Path(description="The anchor's id, percent-escaped.", examples=["1"], json_schema_extra=ID_SCHEMA)
    ],
) -> str:
    return id_of(anchor)


TagId = Annotated[str, Depends(_tag_id)]
AnchorId = Annotated[str, Depends(_anchor_id)]


def _split(values: list[str]) -> list[str]:
    names = [name for value in values for name in value.split(",")]
    for name in names:
        chunk_from_id(name)
    return names


Ids = Annotated[str, Field(min_length=1, json_schema_extra={"format": "dropanchor-ids"})]


class TagFilter(BaseModel):
    """The query of a route that can be asked for some tags only."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    tags: Annotated[list[Ids], AfterValidator(_split)] = Field(
        default=[],
        description="Only these tags: separated by commas, or the parameter repeated. A tag that is not known is left "
        "out. Without it: all tags.",
        examples=[["tag-1,tag-2"]],
    )


class AtTime(BaseModel):
    """The query of a route that can answer for another time."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    at: int | None = Field(
        default=None,
        ge=0,
        lt=2**63,
        description="UTC, ns: the pose at that time instead of the latest one. In the past between two poses that are "
        "at most 1 s apart, as far back as the memory goes (a minute, less in a very large fleet); before that, where "
        "the service keeps a history, between two poses at most 10 s apart, with a covariance that says how far the "
        "tag can have strayed between them; up to 2 s after the newest pose, carried on with its speed and yaw rate, "
        "with a covariance that grows. Without hypotheses.",
        examples=[1_800_000_000_000_000_000],
    )


class LastInnovations(BaseModel):
    """The query of an explanation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    last: int = Field(default=50, ge=1, le=300, description="How many innovations, the newest ones.")


@contextmanager
def saving() -> Iterator[None]:
    """Around a change of the site: what could not be written was not changed either."""
    try:
        yield
    except OSError as error:
        raise ProblemError(Kind.NOT_SAVED, f"The change was not made: {error.strerror or error}.") from error
