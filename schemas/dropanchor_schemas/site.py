"""What an operator knows: the site, its anchors, and settings per tag."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, FiniteFloat, model_validator
from pydantic.config import JsonDict

from dropanchor_schemas.keys import chunk_from_id
from dropanchor_schemas.wire import anchor_number


def _has_a_key(identifier: str) -> str:
    chunk_from_id(identifier)
    return identifier


ID_SCHEMA: JsonDict = {"format": "dropanchor-id", "minLength": 1, "maxLength": 64}
"""JSON Schema of an id: printable characters only, which no portable pattern can say."""

Id = Annotated[str, Field(min_length=1, max_length=64, json_schema_extra=ID_SCHEMA), AfterValidator(_has_a_key)]


class Typed(str):
    """Text in which a number may stand, such as that of an environment variable. In JSON and TOML none does."""


def _of_its_own_type(value: object) -> object:
    if isinstance(value, str) and not isinstance(value, Typed):
        raise ValueError("a number was expected, not a text")
    if isinstance(value, bool):
        raise ValueError("a number was expected, not true or false")
    return value


def _true_or_false(value: object) -> object:
    if not isinstance(value, bool | Typed):
        raise ValueError("true or false was expected")
    return value


_Own = BeforeValidator(_of_its_own_type)  # after the limits: what stands before them hides them from JSON Schema
Number = Annotated[FiniteFloat, _Own]
Truth = Annotated[bool, BeforeValidator(_true_or_false)]
Positive = Annotated[FiniteFloat, Field(gt=0), _Own]
NotNegative = Annotated[FiniteFloat, Field(ge=0), _Own]


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Anchor(_Settings):
    """A dropped UWB anchor. Position in the site frame, m."""

    id: Id = Field(description="As the tags send it: a number in decimal, or a text.")
    x: Number = 0.0
    y: Number = 0.0
    z: Number = Field(default=0.0, description="Height above the plane from which tag heights are counted.")

    @property
    def number(self) -> int:
        """The u32 of this anchor in packed payloads."""
        return anchor_number(self.id)


class Georeference(_Settings):
    """Where the origin of the site frame lies on the Earth (WGS 84)."""

    lat: Annotated[FiniteFloat, Field(ge=-90, le=90), _Own]
    lon: Annotated[FiniteFloat, Field(ge=-180, le=180), _Own]
    rotation_rad: Number = Field(default=0.0, description="Direction of the x axis, counter-clockwise from east.")


class StartPose(_Settings):
    """Where a tag is when it is first heard."""

    x: Number
    y: Number
    heading_rad: Number | None = Field(default=None, description="Leave out when the IMU has a magnetometer.")
    std_m: Positive = Field(default=0.1, description="Standard deviation of x and of y.")


class TagSettings(_Settings):
    """What an operator knows about a tag: measured range = range_scale · distance + range_bias_m."""

    height_m: Number = Field(default=0.0, description="Height of the tag's antenna, on the anchors' z axis.")
    range_std_m: Positive | None = Field(default=None, description="Of one range; null: the engine's default.")
    range_bias_m: Number = 0.0
    range_bias_std_m: NotNegative | None = Field(
        default=None, description="How well that is known; 0: exactly, null: not calibrated, the engine's default."
    )
    range_scale: Positive = 1.0
    mount_angle_rad: Number | None = Field(
        default=None, description="Direction of travel minus body x axis, counter-clockwise; null: not known."
    )
    mount_angle_std_rad: NotNegative | None = Field(
        default=None, description="How well that is known; 0: exactly, null: the engine's default."
    )
    lever_forward_m: Number = Field(
        default=0.0,
        description="How far antenna and IMU sit before the point that follows the course (rear axle, feet of whoever "
        "carries the tag), along body x axis.",
    )
    lever_left_m: Number = Field(default=0.0, description="How far to the left of it, along body y axis.")
    slip_std_rad: NotNegative | None = Field(
        default=None,
        description="Of the direction of travel about body x axis plus mounting angle: slip of what drives, sway of "
        "what is carried; 0: none, null: the engine's default.",
    )
    speed_max_mps: Positive | None = Field(
        default=None, description="It never moves faster; null: not told, the engine's default."
    )
    reverse_allowed: Truth = Field(default=False, description="Whether the tag may move backwards.")
    heading_source: Literal["auto", "imu", "platform"] = Field(
        default="auto", description="auto: the IMU where it is sent, else the platform's heading."
    )
    heading_std_rad: NotNegative | None = Field(
        default=None,
        description="Constant or slow error of the platform's heading, which then does not drift; 0: only noise, null: "
        "not known, it may drift.",
    )
    start: StartPose | None = None


class Site(_Settings):
    """One site: its frame and its anchors. An empty list of anchors binds the first anchor heard to the origin."""

    id: Id = "default"
    name: str = ""
    declination_rad: Number = Field(default=0.0, description="True minus magnetic north, positive east.")
    georeference: Georeference | None = None
    anchors: list[Anchor] = []

    @model_validator(mode="after")
    def _anchors_are_distinct(self) -> "Site":
        by_number: dict[int, str] = {}
        for anchor in self.anchors:
            if anchor.number in by_number:
                raise ValueError(f"anchors {by_number[anchor.number]!r} and {anchor.id!r} share one number")
            by_number[anchor.number] = anchor.id
        return self
