"""Models of the track of a tag, which the service returns page by page."""

from pydantic import Field

from dropanchor_schemas.models import Frozen
from dropanchor_schemas.pose import Frame, HeightSource, RelativePose, TrackingState


class TrackPose(Frozen):
    """A pose as it was stored when it was computed. Numbers have float32 precision."""

    t_ns: int = Field(description="UTC, ns: the time of the pose.")
    t_utc: str = Field(description="The same time as ISO 8601.")
    state: TrackingState
    reason: str = Field(description="Machine-readable reason of the state.")
    frame: Frame = Field(description="`relative`: the place was known in a frame of the tag's own only.")
    relative_pose: RelativePose | None = Field(
        description="The place in the tag's own frame; null unless `frame` is `relative`."
    )
    x: float | None = Field(description="East, m; null if it was unknown.")
    y: float | None = Field(description="North, m.")
    z: float | None = Field(default=None, description="As in a pose; null if it was stored before heights were.")
    z_std_m: float | None = Field(default=None, description="Standard deviation of z, m.")
    z_source: HeightSource | None = None
    floor: str | None = Field(default=None, description="As in a pose, by the current floors of the plans.")
    floor_probability: float | None = None
    heading_rad: float | None
    speed_mps: float | None
    yaw_rate_radps: float | None
    p_mode: float | None
    sigma_pos_m: float | None
    sigma_obs_m: float | None
    range_m: float | None
    covariance: list[list[float]] | None = Field(description="3 × 3, of (x, y, heading_rad).")
    anchor: str | None
    lat: float | None = Field(default=None, description="Degrees, with the site's current georeference.")
    lon: float | None = None
    alt_m: float | None = Field(default=None, description="z plus `alt_m` of the georeference; null without both.")
    epoch: int = Field(
        ge=0, description="Of the process that wrote the pose, as in a live pose; 0 where no cluster wrote it."
    )


class Track(Frozen):
    """One page of the track of a tag."""

    tag: str
    from_ns: int = Field(description="UTC, ns: start of the interval, inclusive.")
    to_ns: int = Field(description="UTC, ns: end of the interval, inclusive.")
    poses: list[TrackPose] = Field(description="Poses in order of time.")
    next: str | None = Field(description="`cursor` of the next page; null on the last page.")
