"""What the routes of the history share: a period, and the problems of a history that is missing or unreadable."""

from collections.abc import Iterator
from contextlib import contextmanager

from pydantic import BaseModel, ConfigDict, Field

from dropanchor_schemas.site import Label
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.routes.known_tag import unknown_tag
from dropanchor_service.api.routes.parameters import TagFilter, TimeNs
from dropanchor_service.history.errors import HistoryError, TooMuchError
from dropanchor_service.history.tracks import Tracks

HOUR_NS = 3_600_000_000_000
MAX_PERIOD_NS = 31 * 24 * HOUR_NS


class Period(BaseModel):
    """The query of a route that reads a period of the history."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    from_ns: TimeNs | None = Field(
        default=None,
        alias="from",
        description="Start of the period, UTC in ns, or ISO 8601 with a time zone. "
        "The default is one hour before `to`.",
    )
    to_ns: TimeNs | None = Field(
        default=None,
        alias="to",
        description="End of the period, UTC in ns, or ISO 8601 with a time zone, "
        "at most 31 days after `from`. The default is now.",
    )


class TagsInPeriod(TagFilter, Period):
    """The query of a route that reads a period of selected tags."""

    group: list[Label] = Field(
        default=[],
        max_length=100,
        description="Only tags whose settings name this group now. Repeat the parameter for several groups; an empty "
        "one stands for tags without a group.",
        examples=[["forklifts"]],
    )

    def of_names(self, answers: Answers, names: list[str]) -> list[str]:
        """Return those of these tags that the query selects."""
        listed = set(self.tags)
        names = [name for name in names if not listed or name in listed]
        if not self.group:
            return names
        are_in = answers.site.groups.are_in(names, self.group)
        return [name for name, is_in in zip(names, are_in, strict=True) if is_in]


def selected_tags(answers: Answers, tracks: Tracks, query: TagsInPeriod) -> list[str] | None:
    """Return the tags that the query names, None for all. Raises HistoryError."""
    if not query.group:
        return query.tags or None
    return query.of_names(answers, query.tags or tracks.reader.tags())


def limits_of(period: Period, now_ns: int) -> tuple[int, int]:
    """Return the start and the end of the period, both included. Raises ProblemError."""
    to_ns = now_ns if period.to_ns is None else period.to_ns
    from_ns = max(0, to_ns - HOUR_NS) if period.from_ns is None else period.from_ns
    require_order(from_ns, to_ns)
    if to_ns - from_ns > MAX_PERIOD_NS:
        raise ProblemError(Kind.INVALID_REQUEST, "query.from: is more than 31 days before `to`")
    return from_ns, to_ns


def require_order(from_ns: int, to_ns: int) -> None:
    """Raise ProblemError when the period ends before it begins."""
    if from_ns > to_ns:
        raise ProblemError(Kind.INVALID_REQUEST, "query.from: is later than `to`")


def history_of(answers: Answers) -> Tracks:
    """Return the history. Raises ProblemError when the service stores none."""
    if answers.tracks is None:
        raise ProblemError(
            Kind.NO_HISTORY,
            "Start the service with `--data-dir FOLDER`, or set `data_dir` or `history.url`, and leave "
            "`history.enabled` at true.",
        )
    return answers.tracks


def require_known(answers: Answers, tracks: Tracks, tag: str) -> None:
    """Raise ProblemError when neither this process nor the stored history has seen the tag."""
    if answers.tags.find(tag) is None and not tracks.reader.has_tag(tag):
        raise unknown_tag(tag)


@contextmanager
def reading_history() -> Iterator[None]:
    """Turn a history that cannot be read, and a request for too much of it, into a problem."""
    try:
        yield
    except TooMuchError as error:
        raise ProblemError(Kind.INVALID_REQUEST, f"query: {error}") from error
    except HistoryError as error:
        raise ProblemError(Kind.HISTORY_UNREADABLE, f"The history cannot be read: {error}.") from error
