"""Models of what the black box tells of a time that is past."""

from enum import StrEnum
from typing import Self

from pydantic import Field, model_validator

from dropanchor_schemas.models import Exact, Frozen
from dropanchor_schemas.pose import Phrase, TrackingState
from dropanchor_schemas.site import Anchor, Number, TagSettings

MOST_NS = 1_800_000_000_000  # of a run with other settings: half an hour


class TrackColumns(Frozen):
    """The poses of a tag, in columns."""

    t_ns: list[int]
    x: list[float | None]
    y: list[float | None]
    heading_rad: list[float | None]
    speed_mps: list[float | None]
    sigma_pos_m: list[float | None]
    state: list[TrackingState]


class StateChange(Frozen):
    """When the state of a tag became another one, and why."""

    t_ns: int
    state: TrackingState
    reason: str


class IncidentKind(StrEnum):
    """What happened to the samples of a tag."""

    REJECTED = "rejected"
    CLOCK_JUMP = "clock_jump"
    RESTART = "restart"
    MISSING = "missing"


class Incident(Frozen):
    """Something that happened to the samples of a tag within a second."""

    t_ns: int = Field(description="UTC, ns: when the first of them was processed.")
    kind: IncidentKind = Field(
        description="rejected: samples or messages were refused. clock_jump: the tag's clock was set. restart: its "
        "numbers began again. missing: messages never came."
    )
    reason: str | None = Field(description="The reason of a rejection.")
    count: int


class Cause(Frozen):
    """What made the poses of a tag wrong though no setting changed, as its samples or those of all tags show."""

    text: str
    phrase: Phrase = Field(description="That sentence by its code.")
    from_ns: int = Field(description="UTC, ns: shortly before it began, for a run with what is told below.")
    mount_angle_rad: float | None = Field(default=None, description="The mounting angle that was right since.")
    anchor: str | None = Field(default=None, description="The anchor that was moved. Only people know where to.")


class Past(Frozen):
    """What happened to a tag until a time that is past, and a little after it."""

    at_ns: int = Field(description="UTC, ns: the time that was asked for.")
    run_from_ns: int = Field(description="UTC, ns: the checkpoint from which the engine ran again.")
    states: list[StateChange] = Field(description="What state the tag had first, and each change until `at_ns`.")
    incidents: list[Incident] = Field(description="Of the run, up to `at_ns`; the newest 200.")
    causes: list[Cause] = Field(default=[], description="What was wrong then; empty where nothing shows it.")
    track: TrackColumns = Field(description="The poses of the minute before.")
    next: TrackColumns = Field(description="The poses of the ten seconds after, as the service then told them.")


class WhatIf(Exact):
    """Which minutes to run again, and what to change from their beginning on."""

    from_ns: int = Field(
        ge=0, lt=2**62, description="UTC, ns. The tag goes on from where it was then, or last knew to be before."
    )
    to_ns: int = Field(ge=0, lt=2**62, description="UTC, ns; at most half an hour later.")
    settings: TagSettings = Field(
        default=TagSettings(), description="Settings of the tag that differ; what is left out is as it was."
    )
    anchors: list[Anchor] = Field(default=[], max_length=64, description="Anchors that were somewhere else.")
    declination_rad: Number | None = Field(default=None, description="Another declination of the site.")

    @model_validator(mode="after")
    def _period_fits(self) -> Self:
        if not 0 < self.to_ns - self.from_ns <= MOST_NS:
            raise ValueError("`to_ns` must be later than `from_ns`, by at most half an hour")
        return self


class WhatIfAnswer(Frozen):
    """The same minutes with the settings of then, and with the others."""

    run_from_ns: int = Field(description="UTC, ns: the checkpoint from which the engine ran again.")
    began_at_pose: bool = Field(description="Whether the tag knew where it was then, and went on from there.")
    as_was: TrackColumns
    what_if: TrackColumns
    apart_m: float | None = Field(description="How far the last places are apart, m; null where one is unknown.")
