"""Models of the tracks of many tags over a period: figures, and a few points of each."""

from enum import StrEnum

from pydantic import Field

from dropanchor_schemas.models import Frozen
from dropanchor_schemas.pose import Frame, HeightSource, RelativePose, TrackingState


class Between(StrEnum):
    """What is known of the way of a tag between two points."""

    TRACKING = "tracking"
    DOUBTFUL = "doubtful"
    UNKNOWN = "unknown"


class TrackPoints(Frozen):
    """Points of a track in order of time, as columns of equal length. Each point is a stored pose."""

    t_ns: list[int] = Field(description="UTC, ns.")
    state: list[TrackingState]
    frame: list[Frame] = Field(description="`relative`: the place was known in a frame of the tag's own only.")
    relative_pose: list[RelativePose | None] = Field(
        description="The place in the tag's own frame; null unless `frame` is `relative`."
    )
    x: list[float | None] = Field(description="East, m.")
    y: list[float | None] = Field(description="North, m.")
    z: list[float | None] = Field(description="Height, as in a pose, m; null if it was stored before heights were.")
    z_std_m: list[float | None] = Field(description="Standard deviation of z, m.")
    z_source: list[HeightSource | None]
    floor: list[str | None] = Field(description="As in a pose, by the current floors of the plans.")
    floor_probability: list[float | None]
    heading_rad: list[float | None]
    speed_mps: list[float | None]
    sigma_pos_m: list[float | None] = Field(description="One standard deviation of the position.")
    semi_major_m: list[float | None] = Field(description="Of the 95 % ellipse.")
    semi_minor_m: list[float | None]
    angle_rad: list[float | None]
    since_previous: list[Between] = Field(
        description="The worst of all stored poses since the previous point. `doubtful`: some were coasting or "
        "degraded. `unknown`: some were at no place of the map, or there was none for over 10 s; draw no line then."
    )
    off_m: list[float | None] = Field(
        description="How far the stored poses since the previous point are from the straight line, at most, m. Null: "
        "not known, so a line is only a sketch."
    )


class TagSummary(Frozen):
    """How far and how fast a tag went over the period."""

    tag: str
    poses: int = Field(description="Stored poses in the period.")
    tracked_s: float = Field(description="How long the tag was `tracking` in the frame of the site.")
    distance_m: float = Field(
        description="Length of the way while tracking. A tag that is slower than 0.1 m/s counts as standing."
    )
    mean_speed_mps: float | None = Field(description="Distance by tracked time; null if the tag was never tracking.")
    max_speed_mps: float | None = Field(description="Of the stored poses that were tracking.")


class TagTrack(TagSummary):
    """The track of a tag over the period."""

    points: TrackPoints


class Tracks(Frozen):
    """The tracks of many tags over a period."""

    from_ns: int = Field(description="UTC, ns: start of the period, inclusive.")
    to_ns: int = Field(description="UTC, ns: end of the period, inclusive.")
    tracks: list[TagTrack] = Field(description="One for each tag with a stored pose in the period, ordered by name.")


class History(Frozen):
    """Whether poses are stored, and which time they cover."""

    enabled: bool = Field(description="Whether the service stores a history.")
    from_ns: int | None = Field(description="UTC, ns: the oldest pose is up to 10 s younger. Null without a pose.")
    to_ns: int | None = Field(description="UTC, ns: the newest pose is up to 10 s older.")


class Stretch(Frozen):
    """A time in which poses are stored."""

    from_ns: int = Field(description="UTC, ns, inclusive.")
    to_ns: int = Field(description="UTC, ns, exclusive.")


class Coverage(Frozen):
    """When poses of any tag are stored."""

    from_ns: int | None = Field(
        description="UTC, ns: start of the period. Null without a pose, if the request has none."
    )
    to_ns: int | None = Field(description="UTC, ns: end of the period. Null without a pose, if the request has none.")
    step_ns: int = Field(description="Shorter gaps are not seen, ns.")
    stretches: list[Stretch] = Field(description="In order of time.")
