"""What an operator knows of the site, its anchors and each tag."""

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
    """Text that may hold a number, as an environment variable does. In JSON and TOML a number is no text."""


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
    """A dropped UWB anchor and its position in the site frame."""

    id: Id = Field(description="Id as the tags send it: a decimal number, or text.")
    x: Number = Field(default=0.0, description="Position along the site's x axis.")
    y: Number = Field(default=0.0, description="Position along the site's y axis.")
    z: Number = Field(default=0.0, description="Height above the plane from which tag heights count.")

    @property
    def number(self) -> int:
        """The number (u32) that names this anchor in packed payloads."""
        return anchor_number(self.id)


class Georeference(_Settings):
    """Where the origin of the site frame lies on the Earth (WGS 84)."""

    lat: Annotated[FiniteFloat, Field(ge=-90, le=90, description="Latitude of the origin, degrees."), _Own]
    lon: Annotated[FiniteFloat, Field(ge=-180, le=180, description="Longitude of the origin, degrees."), _Own]
    rotation_rad: Number = Field(
        default=0.0, description="Direction of the site's x axis, counter-clockwise from east."
    )


class StartPose(_Settings):
    """Where a tag is when it is first heard."""

    x: Number = Field(description="Position along the site's x axis.")
    y: Number = Field(description="Position along the site's y axis.")
    heading_rad: Number | None = Field(
        default=None, description="Heading, counter-clockwise from east. Leave it out when the IMU has a magnetometer."
    )
    std_m: Positive = Field(default=0.1, description="Standard deviation of x and of y.")


class TagSettings(_Settings):
    """What an operator knows about a tag. Its measured range is range_scale · distance + range_bias_m."""

    height_m: Number = Field(default=0.0, description="Height of the tag's antenna, along the anchors' z axis.")
    range_std_m: Positive | None = Field(
        default=None, description="Standard deviation of one range; null: the engine's default."
    )
    range_bias_m: Number = Field(default=0.0, description="What a range is too long by, after the scale.")
    range_bias_std_m: NotNegative | None = Field(
        default=None,
        description="Standard deviation of the bias; 0: exact, null: not calibrated, the engine's default.",
    )
    range_scale: Positive = Field(default=1.0, description="Measured length per metre of distance.")
    mount_angle_rad: Number | None = Field(
        default=None, description="Direction of travel minus direction of body x, counter-clockwise; null: not known."
    )
    mount_angle_std_rad: NotNegative | None = Field(
        default=None, description="Standard deviation of the mounting angle; 0: exact, null: the engine's default."
    )
    lever_forward_m: Number = Field(
        default=0.0,
        description="How far the tag sits in front of the point that follows the course (the rear axle, the feet of "
        "whoever carries it), along body x.",
    )
    lever_left_m: Number = Field(
        default=0.0, description="How far the tag sits to the left of that point, along body y."
    )
    slip_std_rad: NotNegative | None = Field(
        default=None,
        description="Standard deviation of the direction of travel about body x plus mounting angle: slip of a "
        "vehicle, sway of a carrier; 0: none, null: the engine's default.",
    )
    speed_max_mps: Positive | None = Field(
        default=None, description="Top speed of the tag; null: not known, the engine's default."
    )
    reverse_allowed: Truth = Field(default=False, description="Whether the tag may move backwards.")
    heading_source: Literal["auto", "imu", "platform"] = Field(
        default="auto",
        description="Where the heading comes from; auto: the IMU where its samples come, otherwise the platform.",
    )
    heading_std_rad: NotNegative | None = Field(
        default=None,
        description="Constant or slow error of a platform's heading that does not drift; 0: only noise, null: not "
        "known, it may drift.",
    )
    start: StartPose | None = Field(default=None, description="Where the tag starts, if known.")


class Site(_Settings):
    """One site: its frame and its anchors. Without anchors, the first one that is heard becomes the origin."""

    id: Id = Field(default="default", description="Id of the site in Zenoh keys.")
    name: str = Field(default="", description="Name for people.")
    declination_rad: Number = Field(default=0.0, description="Declination: true minus magnetic north, positive east.")
    georeference: Georeference | None = None
    anchors: list[Anchor] = Field(default=[], description="The anchors of the site.")

    @model_validator(mode="after")
    def _anchors_are_distinct(self) -> "Site":
        by_number: dict[int, str] = {}
        for anchor in self.anchors:
            if anchor.number in by_number:
                raise ValueError(f"anchors {by_number[anchor.number]!r} and {anchor.id!r} share one number")
            by_number[anchor.number] = anchor.id
        return self
