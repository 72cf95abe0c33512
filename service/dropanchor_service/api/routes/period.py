"""What the routes of the history share: a period, and the problems of a history that is missing or unreadable."""

import sqlite3

from pydantic import BaseModel, ConfigDict, Field

from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.routes.known_tag import unknown_tag
from dropanchor_service.api.routes.parameters import TimeNs
from dropanchor_service.history.tracks import Tracks

HOUR_NS = 3_600_000_000_000
MAX_PERIOD_NS = 31 * 24 * HOUR_NS


class Period(BaseModel):
    """The query of a route that reads a period of the history."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    from_ns: TimeNs | None = Field(
        default=None,
        alias="from",
        ge=0,
        lt=2**62,
        description="Start of the period, UTC in ns, or ISO 8601 with a time zone. "
        "The default is one hour before `to`.",
    )
    to_ns: TimeNs | None = Field(
        default=None,
        alias="to",
        ge=0,
        lt=2**62,
        description="End of the period, UTC in ns, or ISO 8601 with a time zone, "
        "at most 31 days after `from`. The default is now.",
    )


def limits_of(period: Period, now_ns: int) -> tuple[int, int]:
    """Return the start and the end of the period, both included. Raises ProblemError."""
    to_ns = now_ns if period.to_ns is None else period.to_ns
    from_ns = max(0, to_ns - HOUR_NS) if period.from_ns is None else period.from_ns
    if from_ns > to_ns:
        raise ProblemError(Kind.INVALID_REQUEST, "query.from: is later than `to`")
    if to_ns - from_ns > MAX_PERIOD_NS:
        raise ProblemError(Kind.INVALID_REQUEST, "query.from: is more than 31 days before `to`")
    return from_ns, to_ns


def history_of(answers: Answers) -> Tracks:
    """Return the history. Raises ProblemError when the service stores none."""
    if answers.tracks is None:
        raise ProblemError(
            Kind.NO_HISTORY,
            "Start the service with `--data-dir FOLDER`, or set `data_dir`, and leave `history.enabled` at true.",
        )
    return answers.tracks


def require_known(answers: Answers, tracks: Tracks, tag: str) -> None:
    """Raise ProblemError when neither this process nor the stored history has seen the tag."""
    if answers.tags.find(tag) is None and not tracks.has_tag(tag):
        raise unknown_tag(tag)


def unreadable(error: sqlite3.Error) -> ProblemError:
    return ProblemError(Kind.HISTORY_UNREADABLE, f"The history file cannot be read: {error}.")
