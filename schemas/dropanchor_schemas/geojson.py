"""Models of poses as GeoJSON (RFC 7946, WGS 84). The properties of a feature are the pose, with its lat and lon."""

from typing import Annotated, Literal

from pydantic import Field

from dropanchor_schemas.models import Frozen
from dropanchor_schemas.pose import Pose, TimedPose
from dropanchor_schemas.track import TrackPose


class Point(Frozen):
    """A place on the earth."""

    type: Literal["Point"]
    coordinates: Annotated[list[float], Field(min_length=2, max_length=3)] = Field(
        description="Longitude and latitude, degrees; altitude, m, if the georeference has one."
    )


class _Feature(Frozen):
    type: Literal["Feature"]
    geometry: Point | None = Field(description="null while the position is unknown.")


class PoseFeature(_Feature):
    """A pose of a list."""

    id: str = Field(description="The tag.")
    properties: Pose


class TimedPoseFeature(_Feature):
    """The pose of one tag."""

    id: str = Field(description="The tag.")
    properties: TimedPose


class TrackFeature(_Feature):
    """A stored pose."""

    properties: TrackPose


class _Collection(Frozen):
    type: Literal["FeatureCollection"]


class PoseFeatureCollection(_Collection):
    """Poses of many tags."""

    t_ns: int = Field(description="UTC, ns: the time of the answer.")
    features: list[PoseFeature]


class TrackFeatureCollection(_Collection):
    """One page of the track of a tag, or all of it."""

    tag: str
    from_ns: int = Field(description="UTC, ns: start of the interval, inclusive.")
    to_ns: int = Field(description="UTC, ns: end of the interval, inclusive.")
    features: list[TrackFeature] = Field(description="Poses in order of time.")
    next: str | None = Field(description="`cursor` of the next page; null on the last page.")
