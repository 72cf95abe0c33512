"""What the service answers: the track of a tag, page by page."""

from pydantic import BaseModel, ConfigDict, Field

from dropanchor_schemas.pose import TrackingState


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True)


class TrackPose(_Answer):
    """A pose as it was kept: what it claimed then. Numbers have the precision of float32."""

    t_ns: int = Field(description="UTC, ns.")
    state: TrackingState
    reason: str = Field(description="Machine-readable cause of the state.")
    x: float | None = Field(description="East, m; null where it was unknown.")
    y: float | None = Field(description="North, m.")
    heading_rad: float | None
    speed_mps: float | None
    yaw_rate_radps: float | None
    p_mode: float | None
    sigma_pos_m: float | None
    sigma_obs_m: float | None
    range_m: float | None
    covariance: list[list[float]] | None = Field(description="3 × 3, of (x, y, heading_rad).")
    anchor: str | None
    lat: float | None = Field(default=None, description="With the georeference that the site has now.")
    lon: float | None = None


class Track(_Answer):
    """A page of the track of a tag."""

    tag: str
    from_ns: int = Field(description="UTC, ns: the poses lie between the two, both included.")
    to_ns: int
    poses: list[TrackPose] = Field(description="In order of time.")
    next: str | None = Field(description="`cursor` of the next page; null on the last one.")
