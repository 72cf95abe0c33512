"""What the service answers besides poses one by one: frames of poses, tags, lists and problems."""

from pydantic import BaseModel, ConfigDict, Field

from dropanchor_schemas.pose import Hypothesis, StateReason, TrackingState
from dropanchor_schemas.site import Anchor, TagSettings


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True)


class PoseFrame(_Answer):
    """Poses of many tags in columns: entry i of every column belongs to tag i. Names and units as in a pose; metres
    and radians are rounded to 4 decimals, degrees to 9. `lat` and `lon` only where the site is georeferenced."""

    t_ns: int = Field(
        description="UTC, ns: the moment of the frame; the pose of tag i, unless it is a replay, is age_s[i] older."
    )
    tags: list[str]
    online: list[bool]
    state: list[TrackingState]
    reason: list[StateReason]
    hint: list[str]
    anchor: list[str | None]
    age_s: list[float]
    x: list[float | None]
    y: list[float | None]
    heading_rad: list[float | None]
    speed_mps: list[float | None]
    yaw_rate_radps: list[float | None]
    range_m: list[float | None]
    p_mode: list[float | None]
    sigma_pos_m: list[float | None]
    sigma_obs_m: list[float | None]
    semi_major_m: list[float | None] = Field(description="Of the 95 % ellipse.")
    semi_minor_m: list[float | None]
    angle_rad: list[float | None]
    hypotheses: list[list[Hypothesis] | None] = Field(description="Of tags that are ambiguous, null for others.")
    lat: list[float | None] | None = None
    lon: list[float | None] | None = None


class TagStatus(_Answer):
    """One tag: when it was heard, what came from it, and its settings."""

    tag: str
    online: bool = Field(description="Whether the tag's liveliness token is present.")
    first_heard_ns: int | None = Field(description="UTC, ns; null while nothing has been heard.")
    last_heard_ns: int | None
    messages: int
    samples: dict[str, int] = Field(description="Samples that were used, by kind.")
    rejected: dict[str, int] = Field(description="Messages and samples that were not used, by reason.")
    hint: str = Field(
        description="What a human can do so that more of it is used, such as for an anchor that the site does not "
        "have; empty when nothing is needed."
    )
    settings: TagSettings


class TagList(_Answer):
    """Every tag that has been heard or configured."""

    t_ns: int = Field(description="UTC, ns: the moment of the answer.")
    tags: list[TagStatus]


class Newcomer(_Answer):
    """A tag that has been heard and has no row."""

    tag: str
    first_heard_ns: int = Field(description="UTC, ns.")
    last_heard_ns: int
    messages: int


class NewcomerList(_Answer):
    """Who would like to be a tag of this site, heard last first."""

    t_ns: int = Field(description="UTC, ns: the moment of the answer.")
    newcomers: list[Newcomer]


class AnchorList(_Answer):
    """The anchors of the site."""

    anchors: list[Anchor]


class Connect(_Answer):
    """How a tag connects to this site."""

    endpoints: list[str] = Field(description="Of the Zenoh router, such as tcp/127.0.0.1:7447.")
    credentials: bool = Field(description="Whether a tag needs the folder that `dropanchor tag add` makes for it.")
    simulate: str = Field(
        description="A command that starts a simulated tag. Whoever asks from the machine of the service gets it with "
        "the path of the program."
    )


class Health(_Answer):
    """The service answers (live), or can do its work (ready)."""

    status: str
    impaired: list[str] = Field(
        default=[], description="What does not work although live poses do: a history that cannot be written."
    )


class InvalidPart(_Answer):
    """What is wrong at one place of a request."""

    location: str = Field(description="body, query or path, then the way to the value, joined by dots.")
    detail: str


class Problem(_Answer):
    """A problem as in RFC 9457."""

    type: str = Field(description="A URI that stays the same for problems of the same kind.")
    title: str
    status: int
    detail: str
    instance: str = Field(description="The path that was asked.")
    errors: list[InvalidPart] | None = Field(default=None, description="What is wrong with the request, part by part.")
    reasons: list[str] | None = Field(default=None, description="Why the service is not ready.")
