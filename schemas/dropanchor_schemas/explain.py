"""Why a pose is what it is: the answer of the service for one tag."""

from enum import StrEnum

from pydantic import BaseModel, ConfigDict, Field

from dropanchor_schemas.pose import Hypothesis, Pose


class MeasurementKind(StrEnum):
    """What was measured; a range in metres, a bearing in radians."""

    RANGE = "range"
    BEARING = "bearing"


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True)


class Innovation(_Answer):
    """One measurement beside what the likeliest hypothesis expected of it."""

    t_ns: int
    kind: MeasurementKind
    anchor: str | None
    measured: float
    predicted: float
    innovation: float = Field(description="Measured minus predicted.")
    variance: float = Field(description="S, of the innovation.")
    nis: float = Field(description="Innovation² / S: what the gate looks at; 1 on average when the model is right.")
    p_outlier: float | None = Field(
        description="Probability that the measurement is an outlier; null where the engine has a hard gate instead."
    )
    fused: bool = Field(description="Whether it moved the pose; false: gated, or more likely an outlier than not.")


class SpeedEvidence(_Answer):
    """Whether the ranges agree with the speed: a tag that moves along its line of sight changes its range as fast."""

    speed_mps: float | None
    range_rate_mps: float | None = Field(
        description="Slope of the ranges of the last 2 s to the anchor of the last range; null when there are too few."
    )
    predicted_range_rate_mps: float | None = Field(description="Slope of what was predicted for the same ranges.")


class SpeedTrack(_Answer):
    """Speeds of the last minute, in columns; a minute is shorter in a very large fleet."""

    t_ns: list[int]
    speed_mps: list[float | None]


class Explanation(_Answer):
    """What led to the latest pose of a tag."""

    pose: Pose
    hypotheses: list[Hypothesis] = Field(description="Where the tag may be, while it is ambiguous.")
    speed: SpeedEvidence
    speed_track: SpeedTrack
    innovations: list[Innovation] = Field(description="The last ones, oldest first.")
    refused: int = Field(description="How many of these innovations were not fused.")
    samples: dict[str, int] = Field(description="Samples that were used, by kind.")
    rejected: dict[str, int] = Field(description="Messages and samples that were not used, by reason.")
