"""Models that explain the latest pose of one tag."""

from enum import StrEnum

from pydantic import Field

from dropanchor_schemas.models import Frozen
from dropanchor_schemas.past import Past
from dropanchor_schemas.pose import Hypothesis, Phrase, Pose


class MeasurementKind(StrEnum):
    """The kind of a measurement: a range in metres or a bearing in radians."""

    RANGE = "range"
    BEARING = "bearing"


class Innovation(Frozen):
    """One measurement, compared with the prediction of the most likely hypothesis."""

    t_ns: int
    kind: MeasurementKind
    anchor: str | None
    measured: float
    predicted: float
    innovation: float = Field(description="Measured minus predicted.")
    variance: float = Field(description="Innovation variance S.")
    nis: float = Field(
        description="Normalised innovation squared, innovation² / S. The gate tests it; its mean is 1 if the model is "
        "right."
    )
    p_outlier: float | None = Field(
        description="Probability that the measurement is an outlier; null if the engine uses a hard gate instead."
    )
    fused: bool = Field(description="Whether it was fused; false if it was gated or is probably an outlier.")


class SpeedEvidence(Frozen):
    """Whether the ranges agree with the speed: the range rate equals the speed along the line of sight."""

    speed_mps: float | None
    range_rate_mps: float | None = Field(
        description="Slope of the last 2 s of ranges to the anchor of the last range; null if there are too few."
    )
    predicted_range_rate_mps: float | None = Field(description="Slope of the predictions of the same ranges.")


class RangeErrors(Frozen):
    """How much the ranges of the tag scatter, as learned from them; never less than what was told."""

    white_m: float = Field(description="Standard deviation, m, of the error that is new in every range.")
    lasting_m: float = Field(description="Standard deviation, m, of the error that lasts for seconds.")


class UncertaintyCause(StrEnum):
    """What the largest part of an uncertain place comes from."""

    NORTH = "north"
    MOUNT = "mount"
    SPEED = "speed"
    BEARING = "bearing"
    RANGES = "ranges"
    HEIGHT = "height"


class Uncertainty(Frozen):
    """How far the tag may be from its pose along the 95 % ellipse, and what most of it comes from."""

    half_m: float = Field(description="The semi-major axis of the ellipse.")
    largest: UncertaintyCause
    largest_m: float = Field(description="What the largest cause alone would make of `half_m`.")
    text: str = Field(description="The same as a sentence, with what would make the ellipse smaller.")
    phrase: Phrase = Field(description="That sentence by its code.")


class LearnedNorth(Frozen):
    """How far north is off where the tag is, as its track tells it, which began with a told heading."""

    error_rad: float = Field(description="What is to be added to the site's `declination_rad` for this tag.")
    std_rad: float = Field(description="Standard deviation of that.")


class SpeedTrack(Frozen):
    """Speeds of the last minute, in columns. In a very large fleet the history is shorter."""

    t_ns: list[int]
    speed_mps: list[float | None]


class HeightTrack(Frozen):
    """Heights of the last minute, in columns, as `z` and `z_std_m` of poses."""

    t_ns: list[int]
    z: list[float | None]
    z_std_m: list[float | None]


class Explanation(Frozen):
    """The evidence behind the latest pose of a tag."""

    pose: Pose
    hypotheses: list[Hypothesis] = Field(description="Where the tag may be, while it is ambiguous.")
    speed: SpeedEvidence
    speed_track: SpeedTrack
    height_track: HeightTrack
    uncertainty: Uncertainty | None = Field(
        default=None, description="What its ellipse comes from; null where `sigma_parts` of the pose is."
    )
    north: LearnedNorth | None = Field(
        default=None, description="null unless its track tells where north is, beside its magnetometer."
    )
    innovations: list[Innovation] = Field(description="The most recent innovations, oldest first.")
    range_errors: RangeErrors | None = Field(
        default=None,
        description="How much its ranges scatter; null before any, and with an engine that does not learn it.",
    )
    refused: int = Field(description="How many of these innovations were not fused.")
    samples: dict[str, int] = Field(description="Samples that the engine was given, by kind.")
    arrived: dict[str, int] = Field(default={}, description="Samples that arrived in readable messages, by kind.")
    used: dict[str, int] = Field(default={}, description="Samples that the engine used, by kind.")
    rejected: dict[str, int] = Field(description="Messages and samples that were not used, by reason.")
    lag_s: float = Field(
        default=0.0,
        description="How late the poses come at most, because the tag's IMU samples arrive in batches and its ranges "
        "wait for them; 0 for a tag whose samples come in time.",
    )
    past: Past | None = Field(default=None, description="With `at`: what led to this pose and came next; else null.")
