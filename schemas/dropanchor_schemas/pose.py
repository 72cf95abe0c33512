"""Models of poses with their uncertainty and tracking state."""

from enum import StrEnum

from pydantic import BaseModel, ConfigDict, Field

from dropanchor_schemas.sentences import Sentence


class TrackingState(StrEnum):
    """How far a pose can be trusted."""

    INITIALISING = "initialising"
    AMBIGUOUS = "ambiguous"
    RELATIVE = "relative"
    TRACKING = "tracking"
    COASTING = "coasting"
    DEGRADED = "degraded"
    LOST = "lost"


class StateReason(StrEnum):
    """The machine-readable reason of a tracking state."""

    NO_RANGE = "no_range"
    NO_HEADING = "no_heading"
    START_UNKNOWN = "start_unknown"
    SEVERAL_MODES = "several_modes"
    RESOLVED = "resolved"
    RANGES_MISSING = "ranges_missing"
    IMU_MISSING = "imu_missing"
    RANGES_REJECTED = "ranges_rejected"
    HEADING_DISTURBED = "heading_disturbed"
    UNCERTAIN = "uncertain"
    FAULT = "fault"
    HEADING_UNSURE = "heading_unsure"
    SENSOR_FAULT = "sensor_fault"
    ANCHOR_DOUBTED = "anchor_doubted"
    FRONT_OR_BACK = "front_or_back"


class Frame(StrEnum):
    """The frame in which the place of a tag is known."""

    SITE = "site"
    RELATIVE = "relative"


class HeightSource(StrEnum):
    """Where the height of a pose comes from: the settings of the tag, its barometer, or nowhere.

    A height from the `start` counts from where the tag started, because nobody told the height there.
    """

    TOLD = "told"
    PRESSURE = "pressure"
    UNKNOWN = "unknown"
    START = "start"


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True)


class Phrase(_Answer):
    """A sentence of the service by its code, for those who say it in words or a language of their own."""

    code: str = Field(description="What is said. It stays the same when the wording of the sentence changes.")
    values: dict[str, str] = Field(
        description="What stands in the sentence, by name. A value that is a sentence, too, has its code at "
        "`<name>.code` and its values at `<name>.<value>`."
    )

    @classmethod
    def of(cls, text: str) -> "Phrase | None":
        """Return the phrase of a text; None for one without a code."""
        return cls(code=text.code, values=text.values) if isinstance(text, Sentence) else None


class Ellipse(_Answer):
    """The 95 % confidence ellipse of the position."""

    semi_major_m: float
    semi_minor_m: float
    angle_rad: float = Field(description="Direction of the major axis, counter-clockwise from east.")


class Hypothesis(_Answer):
    """One possible pose of an ambiguous tag."""

    weight: float = Field(ge=0, le=1)
    x: float
    y: float
    heading_rad: float
    speed_mps: float
    ellipse_95: Ellipse | None = None


class SigmaParts(_Answer):
    """What the uncertainty of a place is made of, m: what knowing each of them, after those before it, would take away.
    The squares add up to that of `sigma_pos_m`, or of that of `relative_pose`."""

    north_m: float = Field(description="Where north is: the error of the heading, and of what it is measured against.")
    mount_m: float = Field(description="How the tag is mounted or held: the angle between body x and its course.")
    speed_m: float = Field(description="How fast it moves.")
    bearing_m: float = Field(description="In which direction from the anchor it started, and its track since.")
    ranges_m: float = Field(description="The ranges: along the line to the anchor, without the height.")
    height_m: float = Field(description="How high it is: what an unknown height changes of the distance.")


class RelativePose(_Answer):
    """Where a tag is in a frame of its own, while north is not known: the site frame, turned about the tag's first
    anchor by an unknown angle. The anchor is at its x and y of the site, and the x axis is the first direction of
    travel. The shape of the track and the distance from the anchor hold; these numbers are no place of the site."""

    x: float | None
    y: float | None
    heading_rad: float | None = Field(description="Counter-clockwise from the x axis of this frame.")
    covariance: list[list[float]] | None = Field(
        description="3 × 3, of (x, y, heading_rad), in this frame; null in `tracks`."
    )
    ellipse_95: Ellipse | None
    p_mode: float | None = Field(description="As in a pose; null in `tracks`.")
    sigma_pos_m: float | None = Field(description="sqrt(Pxx + Pyy), m, in this frame.")
    hypotheses: list[Hypothesis] = Field(default=[], description="Of an ambiguous tag, in this frame.")


class Pose(_Answer):
    """The pose of one tag at one time. x, y, heading, covariance, ellipse, latitude and longitude are in the site frame
    (ENU, metres, x east) and null while the tag's place in it is unknown. Lists of poses round `covariance`, `lat` and
    `lon` to 9 decimals and all other numbers to 6."""

    tag: str
    t_ns: int = Field(description="UTC, ns: the time for which the pose holds.")
    age_s: float = Field(
        description="Seconds from t_ns to the time of the answer; for a replay, to the current time of the recording."
    )
    state: TrackingState
    reason: StateReason = Field(description="Machine-readable reason of the state.")
    hint: str = Field(description="What an operator can do about it; empty if nothing needs to be done.")
    hint_phrase: Phrase | None = Field(default=None, description="The hint by its code; null without one.")
    frame: Frame = Field(
        description="`relative`: north is not known, so the place is known in a frame of the tag's own only. "
        "`relative_pose` holds it then, and all that depends on the site frame is null."
    )
    relative_pose: RelativePose | None = Field(
        default=None, description="The place in the tag's own frame; null unless `frame` is `relative`."
    )
    x: float | None = Field(description="East, m; null while unknown.")
    y: float | None = Field(description="North, m; null while unknown.")
    z: float | None = Field(default=None, description="Height along the anchors' z axis, m, as `z_source` tells it.")
    z_std_m: float | None = Field(default=None, description="Standard deviation of z, m.")
    z_source: HeightSource | None = Field(
        default=None,
        description="`unknown`: the tag is set to `free` and sends no pressures. `start`: z counts from where "
        "the tag started, because nobody told the height there, so no floor is named. Null without z.",
    )
    floor: str | None = Field(
        default=None, description="The floor of the plans that is likeliest by z and z_std_m; null without one."
    )
    floor_probability: float | None = Field(
        default=None, description="Of `floor`. Believe it above 0.9: height and floor may be unknown."
    )
    heading_rad: float | None = Field(description="Counter-clockwise from east.")
    speed_mps: float | None
    yaw_rate_radps: float | None
    covariance: list[list[float]] | None = Field(description="3 × 3, of (x, y, heading_rad).")
    ellipse_95: Ellipse | None
    p_mode: float | None = Field(description="Probability that the published mode is the right one.")
    sigma_pos_m: float | None = Field(description="sqrt(Pxx + Pyy) in the site frame, m.")
    sigma_parts: SigmaParts | None = Field(
        default=None, description="What `sigma_pos_m` is made of; null where no engine told it, as in the past."
    )
    sigma_obs_m: float | None = Field(description="Position accuracy that the last 10 s of data alone can reach, m.")
    range_m: float | None = Field(description="Last range that was fused, m.")
    anchor: str | None = Field(description="The anchor of that range.")
    hypotheses: list[Hypothesis] = []
    lat: float | None = Field(default=None, description="Degrees; null unless the site is georeferenced.")
    lon: float | None = None
    alt_m: float | None = Field(default=None, description="z plus `alt_m` of the georeference; null without both.")
    online: bool = Field(
        description="Whether the tag's liveliness token is present, its WebSocket is open, or it has sent something "
        "over HTTP in the last 30 s."
    )
    epoch: int = Field(
        default=0,
        ge=0,
        description="Grows each time that another process of a cluster takes the site over; 0 without a cluster. Drop "
        "poses with a lower epoch than you have seen: they are of a process that no longer serves the site.",
    )


class TimedPose(Pose):
    """The pose of one tag over REST, whose time people can read, too."""

    t_utc: str = Field(description="`t_ns` as ISO 8601.")


class PoseList(_Answer):
    """Poses of many tags."""

    t_ns: int = Field(description="UTC, ns: the time of the answer.")
    poses: list[Pose]


class SitePoses(PoseList):
    """Poses of many tags of a site."""

    site: str = Field(description="Id of the site.")


class SitePosesList(_Answer):
    """Poses of the tags of all sites."""

    sites: list[SitePoses]
    unavailable: list[str] = Field(
        default_factory=list,
        description="Of an API node: the buckets whose sites are missing, because nobody serves them now.",
    )


class PoseFrame(_Answer):
    """Poses of many tags in columns: entry i of every column belongs to tag i. Names and units are those of a pose.
    Metres and radians are rounded to 4 decimals, degrees to 9. `lat` and `lon` exist only if the site is
    georeferenced."""

    t_ns: int = Field(
        description="UTC, ns: the time of the frame. The pose of tag i is age_s[i] older, unless the tag is a replay."
    )
    epoch: int = Field(default=0, ge=0, description="As in a pose; of all tags of the frame.")
    tags: list[str]
    online: list[bool]
    state: list[TrackingState]
    reason: list[StateReason]
    hint: list[str]
    hint_phrase: list[Phrase | None] = Field(default=[], description="As in a pose.")
    frame: list[Frame]
    relative_pose: list[RelativePose | None] = Field(description="As in a pose.")
    anchor: list[str | None]
    age_s: list[float]
    x: list[float | None]
    y: list[float | None]
    z: list[float | None]
    z_std_m: list[float | None]
    z_source: list[HeightSource | None]
    floor: list[str | None]
    floor_probability: list[float | None]
    heading_rad: list[float | None]
    speed_mps: list[float | None]
    yaw_rate_radps: list[float | None]
    range_m: list[float | None]
    p_mode: list[float | None]
    sigma_pos_m: list[float | None]
    sigma_obs_m: list[float | None]
    semi_major_m: list[float | None] = Field(description="Semi-major axis of the 95 % ellipse, m.")
    semi_minor_m: list[float | None]
    angle_rad: list[float | None]
    hypotheses: list[list[Hypothesis] | None] = Field(
        description="Hypotheses of an ambiguous tag in the site frame; null otherwise."
    )
    lat: list[float | None] | None = None
    lon: list[float | None] | None = None
