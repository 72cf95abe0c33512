"""The objects of the omlox Hub API that this service writes; clients store those of `store.omlox_models`.

The names of the fields are those of the standard. A field that is null or absent is not set.
"""

from collections.abc import Mapping
from typing import Any, Literal
from uuid import UUID

from pydantic import BaseModel, Field

from dropanchor_service.store.omlox_models import OmloxObject, Point, Polygon, Position, Properties, ProviderType

LOCAL, WGS84 = "local", "EPSG:4326"


class Location(OmloxObject):
    """Where a location provider was at a time."""

    position: Point
    source: str = Field(description="Id of the zone: of the anchor that the provider ranges to.")
    provider_type: ProviderType
    provider_id: str
    trackables: list[UUID] | None = None
    timestamp_generated: str | None = Field(default=None, description="ISO 8601, UTC: the time of the position.")
    timestamp_sent: str | None = None
    crs: str | None = Field(default=None, description="`local` (the frame of the site, m) or `EPSG:4326`.")
    accuracy: float | None = Field(default=None, description="Major axis of the 95 % ellipse (half), m.")
    true_heading: float | None = Field(default=None, description="Degrees clockwise from north; negative: unknown.")
    heading_accuracy: float | None = Field(default=None, description="95 % of errors are smaller, degrees.")
    speed: float | None = Field(default=None, description="m/s.")
    elevation_ref: Literal["floor", "wgs84"] | None = Field(
        default=None, description="What a third coordinate is: absent, the height in the frame of the site."
    )
    properties: Properties | None = Field(
        default=None, description="Of this service: state, reason, hint, covariance of (x, y, heading) and more."
    )


class TrackableMotion(OmloxObject):
    """The location of a trackable."""

    id: UUID
    location: Location
    name: str | None = None
    extrusion: float | None = None
    properties: Properties | None = None


class Zone(OmloxObject):
    """The surroundings of an anchor. All zones of a site share its frame as their local coordinates."""

    id: UUID
    type: Literal["uwb", "wifi", "rfid", "ibeacon"]
    foreign_id: str | None = Field(default=None, description="Id of the anchor.")
    position: Point | None = None
    ground_control_points: list[Position] | None = Field(
        default=None, description="In turn [longitude, latitude] and [x, y] of the same point."
    )
    incomplete_configuration: bool | None = Field(default=None, description="Whether the site has no georeference.")
    site: str | None = None
    name: str | None = None
    properties: Properties | None = None


class Feature(OmloxObject):
    """A feature of GeoJSON."""

    type: Literal["Feature"]
    geometry: Point | Polygon | None
    properties: Properties


class FeatureCollection(OmloxObject):
    """Features of GeoJSON."""

    type: Literal["FeatureCollection"]
    features: list[Feature]


class FenceEvent(OmloxObject):
    """A trackable has entered or left a fence."""

    id: UUID
    fence_id: UUID
    event_type: Literal["region_entry", "region_exit"]
    trackable_id: UUID
    provider_id: None = None
    trackables: list[UUID]
    entry_time: str | None = None
    exit_time: str | None = None
    foreign_id: str | None = None
    properties: Properties | None = None


class OmloxProblem(BaseModel):
    """A problem document (RFC 9457) that also has the members of an omlox error: `type`, `code` and `message`."""

    type: str
    title: str
    status: int
    detail: str
    instance: str
    code: int = Field(description="The HTTP status.")
    message: str
    properties: Properties | None = Field(default=None, description="Why there is no location.")


def without_nulls(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields that are set."""
    return {name: value for name, value in values.items() if value is not None}
