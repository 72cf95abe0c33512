"""Models of what an operator knows about the site, its anchors and each tag."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, FiniteFloat, model_validator
from pydantic.config import JsonDict

from dropanchor_schemas.file_names import file_name_of
from dropanchor_schemas.keys import checked_id
from dropanchor_schemas.models import Exact
from dropanchor_schemas.remote import MAX_BATCH_S, MAX_IMU_HZ, MIN_BATCH_S, MIN_IMU_HZ
from dropanchor_schemas.sentences import say
from dropanchor_schemas.time_zones import TimeZone
from dropanchor_schemas.wire import anchor_number


def _names_files(site: str) -> str:
    file_name_of(site)
    return site


ID_SCHEMA: JsonDict = {"format": "dropanchor-id", "minLength": 1, "maxLength": 64}
"""JSON Schema of an id. No portable pattern can express "printable characters only", hence the format."""

Id = Annotated[str, Field(min_length=1, max_length=64, json_schema_extra=ID_SCHEMA), AfterValidator(checked_id)]
SiteId = Annotated[Id, AfterValidator(_names_files)]
"""The id of a site, of which files and folders get their names."""


def _require_printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError(say("printable", "only printable characters are allowed"))
    return text


Label = Annotated[
    str,
    Field(max_length=64, json_schema_extra={"format": "dropanchor-label"}),
    AfterValidator(_require_printable),
]
"""A short text for people."""


class Typed(str):
    """A string that may hold a number, such as an environment variable. JSON and TOML numbers are never strings."""


def _reject_text_and_booleans(value: object) -> object:
    if isinstance(value, str) and not isinstance(value, Typed):
        raise ValueError(say("number_not_text", "a number was expected, not a text"))
    if isinstance(value, bool):
        raise ValueError(say("number_not_truth", "a number was expected, not true or false"))
    return value


def _require_boolean(value: object) -> object:
    if not isinstance(value, bool | Typed):
        raise ValueError(say("truth", "true or false was expected"))
    return value


# It follows the limits in each annotation: a validator before them would hide them from the JSON Schema.
NumberOnly = BeforeValidator(_reject_text_and_booleans)
Number = Annotated[FiniteFloat, NumberOnly]
StrictBool = Annotated[bool, BeforeValidator(_require_boolean)]
Positive = Annotated[FiniteFloat, Field(gt=0), NumberOnly]
NotNegative = Annotated[FiniteFloat, Field(ge=0), NumberOnly]


class Anchor(Exact):
    """A dropped UWB anchor and its position in the site frame."""

    id: Id = Field(description="Id as the tags send it: a decimal number, or text.")
    x: Number = Field(default=0.0, description="Position along the site's x axis.")
    y: Number = Field(default=0.0, description="Position along the site's y axis.")
    z: Number = Field(default=0.0, description="Height above the plane from which tag heights are measured.")
    facing_rad: Number | None = Field(
        default=None,
        description="Where an anchor that measures azimuths faces, counter-clockwise from the site's x axis. It is "
        "added to the bearings of its tags, and these tell where a tag starts. null: bearings are of the site already.",
    )
    mirrors_behind: StrictBool = Field(
        default=True,
        description="Whether this anchor sees a tag behind it at the mirror image ahead, as one with two antennas "
        "does. false: it tells the two apart, or no tag is ever behind it. It counts with `facing_rad`.",
    )

    @property
    def number(self) -> int:
        """Return the number (u32) of this anchor in packed payloads."""
        return anchor_number(self.id)


class Georeference(Exact):
    """Where the origin of the site frame lies on the Earth (WGS 84)."""

    lat: Annotated[FiniteFloat, Field(ge=-90, le=90, description="Latitude of the origin, degrees."), NumberOnly]
    lon: Annotated[FiniteFloat, Field(ge=-180, le=180, description="Longitude of the origin, degrees."), NumberOnly]
    rotation_rad: Number = Field(
        default=0.0, description="Direction of the site's x axis, counter-clockwise from east."
    )
    alt_m: Number | None = Field(
        default=None, description="Altitude of the height 0 m; null: unknown, and exports have no altitudes."
    )


class StartPose(Exact):
    """Where a tag is when it first sends data."""

    x: Number = Field(description="Position along the site's x axis.")
    y: Number = Field(description="Position along the site's y axis.")
    heading_rad: Number | None = Field(
        default=None, description="Heading, counter-clockwise from east. Omit it if the IMU has a magnetometer."
    )
    std_m: Positive = Field(default=0.1, description="Standard deviation of x and of y.")


class TagSettings(Exact):
    """What an operator knows about a tag. A measured range is range_scale · distance + range_bias_m."""

    name: Label = Field(default="", description="Display name; empty: the id of the tag.")
    colour: Annotated[str, Field(pattern=r"^#[0-9a-f]{6}$")] | None = Field(
        default=None,
        description="Colour that marks the tag on the map, such as #0b62b8; null: none.",
        examples=["#2f7fd0", "#d97a0a", "#1b8a6b", "#b89b00", "#c7609a", "#cf4a12", "#7a8793"],
    )
    group: Label = Field(default="", description="Group that lists and streams can select; empty: none.")
    height_m: Number = Field(
        default=0.0,
        title="Height",
        description="Height of the tag's antenna where it starts, along the anchors' z axis.",
    )
    height_told: StrictBool | None = Field(
        default=None,
        title="Height is told",
        description="Whether the height is that at which the tag starts; null: unless it is 0, which tags have "
        "that nobody told a height. Without it no floor is named.",
    )
    height_motion: Literal["auto", "flat", "free", "reference"] = Field(
        default="auto",
        title="Changes of the height",
        description="What this height does; auto: it stays, or follows the tag's barometer once it sends pressures; "
        "flat: it stays; free: it changes, and is unknown to 10 m without pressures; reference: it stays, and the "
        "pressures of this tag take the weather out of those of the others.",
    )
    range_std_m: Positive | None = Field(
        default=None,
        title="Scatter of ranges",
        description="Standard deviation of one range; null: the engine's default.",
    )
    range_bias_m: Number = Field(
        default=0.0, title="Bias of ranges", description="Constant error of the ranges, after the scale."
    )
    range_bias_std_m: NotNegative | None = Field(
        default=None,
        title="Uncertainty of the bias",
        description="Standard deviation of the bias; 0: exact; null: not calibrated, the engine's default.",
    )
    range_scale: Positive = Field(
        default=1.0, title="Scale of ranges", description="Measured length per metre of distance."
    )
    mount_angle_rad: Number | None = Field(
        default=None,
        title="Mounting angle",
        description="Direction of travel minus direction of body x, counter-clockwise; null: unknown.",
    )
    mount_angle_std_rad: NotNegative | None = Field(
        default=None,
        title="Uncertainty of the mounting angle",
        description="Standard deviation of the mounting angle; 0: exact; null: the engine's default.",
    )
    lever_forward_m: Number = Field(
        default=0.0,
        title="Lever ahead",
        description="Distance of the tag in front of the point that follows the course (the rear axle, or the "
        "carrier's feet), along body x.",
    )
    lever_left_m: Number = Field(
        default=0.0,
        title="Lever to the left",
        description="Distance of the tag to the left of that point, along body y.",
    )
    slip_std_rad: NotNegative | None = Field(
        default=None,
        title="Slip",
        description="Standard deviation of the direction of travel about body x plus the mounting angle, caused by "
        "the slip of a vehicle or the sway of a carrier; 0: none; 3: it moves in any direction, as a drone does; null: "
        "the engine's default.",
    )
    speed_max_mps: Positive | None = Field(
        default=None, title="Top speed", description="Top speed of the tag; null: unknown, the engine's default."
    )
    reverse_allowed: StrictBool = Field(
        default=False,
        title="Moves backwards",
        description="Whether the tag moves backwards as often as ahead. If false, the engine fleet finds out by itself "
        "when a tag with an accelerometer reverses after a stop.",
    )
    heading_source: Literal["auto", "imu", "platform"] = Field(
        default="auto",
        title="Source of the heading",
        description="Source of the heading; auto: the IMU if the tag sends IMU samples, otherwise the platform.",
    )
    heading_std_rad: NotNegative | None = Field(
        default=None,
        title="Error of the heading",
        description="Standard deviation of the constant or slowly varying error of a platform heading that does not "
        "drift; 0: only noise; null: unknown, the heading may drift. With heading_source imu: how far the field where "
        "the tag is turns north, beside the errors that the magnetometer shows; null: unknown.",
    )
    magnetometer_calibrated: StrictBool = Field(
        default=False,
        title="Magnetometer is calibrated",
        description="Whether the tag's magnetometer is calibrated where it is mounted, to 5 % of the field. Its "
        "heading then counts at once, otherwise after the first turns.",
    )
    motion: Literal["vehicle", "carried", "auto"] = Field(
        default="auto",
        title="Moved by",
        description="What moves the tag: a vehicle, which follows its course, or a person on foot, who may hold the "
        "tag in any way; auto: a person while the accelerations show steps, otherwise a vehicle.",
    )
    acc_unit: Literal["m/s2", "g", "mg"] = Field(
        default="m/s2",
        title="Unit of accelerations",
        description="Unit in which the tag sends accelerations; they are converted before their check.",
    )
    acc_reversed: StrictBool | None = Field(
        default=None,
        title="Accelerations are reversed",
        description="Whether the accelerations have the opposite sign, as on iOS: down instead of up at rest. If "
        "false, the tag may hang upside down; null: unknown, the check of the sensors looks for it.",
    )
    gyro_unit: Literal["rad/s", "deg/s"] = Field(
        default="rad/s", title="Unit of rates", description="Unit in which the tag sends rates."
    )
    range_unit: Literal["m", "cm", "mm", "ft"] = Field(
        default="m",
        title="Unit of ranges",
        description="Unit in which the tag sends ranges and their standard deviation.",
    )
    start: StartPose | None = Field(default=None, description="Where the tag starts, if known.")

    @property
    def tells_height(self) -> bool:
        """Return whether the height at which the tag starts is known."""
        return self.height_m != 0.0 if self.height_told is None else self.height_told

    def over(self, defaults: "TagSettings") -> "TagSettings":
        """Return these settings, with those of `defaults` where nothing was given."""
        return defaults.model_copy(update={name: getattr(self, name) for name in self.model_fields_set})


class RemoteSettings(Exact):
    """What the service sets in the program of a tag, while it runs."""

    batch_s: Annotated[FiniteFloat, Field(ge=MIN_BATCH_S, le=MAX_BATCH_S), NumberOnly] | None = Field(
        default=None, description="How long samples wait for others in a message; null: as the program says."
    )
    imu_hz: Annotated[FiniteFloat, Field(ge=MIN_IMU_HZ, le=MAX_IMU_HZ), NumberOnly] | None = Field(
        default=None, description="IMU samples per second at most, by means of more; null: as the IMU gives them."
    )


class Site(Exact):
    """One site: its frame and its anchors. Without anchors, the anchor of the first range becomes the origin."""

    id: SiteId = Field(default="default", description="Id of the site in Zenoh keys.")
    name: str = Field(default="", description="Display name.")
    declination_rad: Number = Field(
        default=0.0,
        description="Magnetic declination, positive east, and how far the site's axes are turned from east and north, "
        "counter-clockwise.",
    )
    declination_std_rad: NotNegative | None = Field(
        default=None,
        description="Standard deviation of the declination, beside the 0.1 rad that each tag may be off; null: as if "
        "it were exact. It widens the ellipses of tags whose start was not told.",
    )
    georeference: Georeference | None = None
    time_zone: TimeZone | None = None
    anchors: list[Anchor] = Field(default=[], description="The anchors of the site.")

    @model_validator(mode="after")
    def _anchors_are_distinct(self) -> "Site":
        by_number: dict[int, str] = {}
        for anchor in self.anchors:
            if anchor.number in by_number:
                raise ValueError(
                    say(
                        "anchors_share",
                        "anchors {one} and {other} share one number",
                        one=repr(by_number[anchor.number]),
                        other=repr(anchor.id),
                    )
                )
            by_number[anchor.number] = anchor.id
        return self
