"""What the routes share: ids in paths, query parameters, and JSON responses."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any
from urllib.parse import unquote

from fastapi import Depends, Path, Request
from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, WithJsonSchema
from starlette.responses import Response

from dropanchor_schemas.keys import InvalidKeyError, checked_id
from dropanchor_schemas.models import Exact
from dropanchor_schemas.pose import TrackingState
from dropanchor_schemas.sentences import said_by, say
from dropanchor_schemas.site import ID_SCHEMA, Label
from dropanchor_schemas.times import ns_of_parameter
from dropanchor_service.answers.answers import to_json
from dropanchor_service.answers.pose_filter import PoseFilter
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.http.etags import etag_of
from dropanchor_service.store.preconditions import ChangedMeanwhileError


def json_response(answer: Any, media_type: str = "application/json", status: int = 200) -> Response:
    return Response(to_json(answer), status, media_type=media_type, headers={"cache-control": "no-store"})


def resource_response(resource: BaseModel) -> Response:
    """Return a resource with its `ETag`, to which a change can refer."""
    response = json_response(resource.model_dump())
    response.headers["etag"] = etag_of(resource)
    return response


async def refuse_query(request: Request) -> None:
    """Refuse query parameters on a route without any, so that a misspelt one does not seem to work."""
    if request.query_params:
        name = next(iter(request.query_params))
        raise ProblemError(
            Kind.INVALID_REQUEST,
            say("query_unknown", "query.{name}: is unknown; this resource takes no query parameters", name=name[:64]),
        )


def example_response(example: Any, status: int = 200) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI response of a route with this example of its JSON."""
    return {status: {"content": {"application/json": {"example": example}}}}


NO_QUERY = Depends(refuse_query)


def id_of(escaped: str) -> str:
    """Return the id in an escaped path segment, which may contain an escaped slash. Raises ProblemError."""
    try:
        identifier = unquote(escaped, errors="strict")
        checked_id(identifier)
    except UnicodeDecodeError as error:
        raise ProblemError(
            Kind.INVALID_REQUEST, say("path_escapes", "The id in the path is not percent-escaped UTF-8.")
        ) from error
    except InvalidKeyError as error:
        raise ProblemError(
            Kind.INVALID_REQUEST, say("path_id", "The id in the path is not valid: {why}.", why=said_by(error))
        ) from error
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


def ids_of(values: list[str]) -> list[str]:
    """Return the ids that a parameter names. Given once, commas separate them; repeated, each value is one id.

    Raises ValueError.
    """
    names = values[0].split(",") if len(values) == 1 else values
    return [checked_id(name) for name in dict.fromkeys(names)]


def words_of(values: Any) -> Any:
    """Return the words in these texts, which commas separate. No word has a comma."""
    return [word for value in values for word in value.split(",")] if isinstance(values, list) else values


COMMA = (
    "Separate ids with commas, or repeat the parameter: then each value is one id, which may have commas (escaped as "
    "%2C or not). A single id with a comma is given twice."
)


_NUMBER = r"-?[0-9]{1,9}(\.[0-9]{1,9})?"
Ids = Annotated[str, Field(min_length=1, json_schema_extra={"format": "dropanchor-ids"})]


class TagFilter(Exact):
    """The query of a route that can return selected tags."""

    tags: Annotated[list[Ids], AfterValidator(ids_of)] = Field(
        default=[],
        description=f"Return only these tags. {COMMA} Unknown tags are left out. The default is all tags.",
        examples=[["tag-1,tag-2"]],
    )


Box = Annotated[str, Field(pattern=rf"^{_NUMBER}(,{_NUMBER}){{3}}$")]


class PoseQuery(TagFilter):
    """The query of a route that can return selected poses."""

    state: Annotated[list[TrackingState], BeforeValidator(words_of)] = Field(
        default=[],
        description="Return only tags in this state. Separate several with commas, or repeat the parameter.",
        examples=[["tracking"]],
    )
    box: Box | None = Field(
        default=None,
        description="Return only tags in this box of the site: x_min,y_min,x_max,y_max in m. A tag whose "
        "state is `relative` is in no box.",
        examples=["-10,-5,30,20"],
    )
    text: str = Field(
        default="", max_length=100, description="Return only tags with this text in their id, in upper or lower case."
    )
    group: list[Label] = Field(
        default=[],
        max_length=100,
        description="Return only tags whose settings name this group. Repeat the parameter for several groups; "
        "an empty one stands for tags without a group.",
        examples=[["forklifts"]],
    )

    @property
    def wanted(self) -> PoseFilter:
        """Return the conditions on the pose itself."""
        return PoseFilter(self.state, None if self.box is None else _corners(self.box), self.text, self.group)


def _corners(box: str) -> tuple[float, float, float, float]:
    x_min, y_min, x_max, y_max = (float(number) for number in box.split(","))
    return x_min, y_min, x_max, y_max


TimeNs = Annotated[
    int,
    Field(ge=0, lt=2**62),
    BeforeValidator(ns_of_parameter),
    WithJsonSchema({"anyOf": [{"type": "integer", "minimum": 0}, {"type": "string", "format": "date-time"}]}),
]
"""A time as UTC in ns, or as ISO 8601 with a time zone. Seconds, milliseconds and microseconds are refused."""


class AtTime(Exact):
    """The query of a route that can return the state at another time."""

    at: TimeNs | None = Field(
        default=None,
        description="Return the pose at this time (UTC in ns, or ISO 8601 with a time zone) instead of the latest one. "
        "For the last minute (less in a very large fleet), the pose is interpolated between two poses in memory that "
        "are at most 1 s apart. For earlier times, it is interpolated between two stored poses at most 10 s apart, if "
        "the service stores a history; the covariance then includes how far the tag may have moved off the line "
        "between them. Up to 2 s after the newest pose, the pose is extrapolated with its speed and yaw rate, and the "
        "covariance grows. Such poses have no hypotheses.",
        examples=[1_800_000_000_000_000_000],
    )


class LastInnovations(Exact):
    """The query of the route that explains a pose."""

    last: int = Field(default=50, ge=1, le=300, description="How many of the newest innovations to return.")
    at: TimeNs | None = Field(
        default=None,
        description="Explain the pose of this time (UTC in ns, or ISO 8601 with a time zone) as it was explained then, "
        "and say in `past` what led to it and came next. Another process runs for some seconds what the black box "
        "holds. Share links explain the latest pose only.",
    )


@contextmanager
def saving() -> Iterator[None]:
    """Turn a change that is refused or cannot be written into a problem. Then nothing has changed."""
    try:
        yield
    except ChangedMeanwhileError as error:
        raise ProblemError(
            Kind.CHANGED_MEANWHILE, say("changed_meanwhile", "Somebody changed this meanwhile: get it and try again.")
        ) from error
    except OSError as error:
        raise ProblemError(
            Kind.NOT_SAVED, say("not_saved", "The change was not made: {why}.", why=error.strerror or error)
        ) from error
