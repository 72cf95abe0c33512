"""The objects of the omlox Hub API that clients store, as far as this service reads or writes them.

The names of the fields are those of the standard. A field that is null or absent is not set.
"""

from typing import Annotated, Any, Literal
from uuid import UUID

import orjson
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat

from dropanchor_schemas.site import Number, NumberOnly
from dropanchor_schemas.zones import MAX_POINTS

MAX_NAME = 100
MAX_RINGS = 8

MAX_BYTES = 65_536
MAX_DEPTH = 32


def _storable(value: object) -> object:
    """Return what a client sends as it can be stored and returned. Raises ValueError."""
    try:
        written = orjson.dumps(value)
    except TypeError as error:
        raise ValueError(f"cannot be stored as JSON: {error}") from error
    if len(written) > MAX_BYTES or _depth(value) > MAX_DEPTH:
        raise ValueError(f"may have at most {MAX_BYTES} bytes of JSON and {MAX_DEPTH} levels")
    stored: object = orjson.loads(written)
    return stored


def _depth(value: object) -> int:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return 1 + max(map(_depth, inner), default=0)


Properties = dict[str, Any]
StoredProperties = Annotated[Properties, AfterValidator(_storable)]
Position = Annotated[list[Number], Field(min_length=2, max_length=3)]
ProviderType = Literal["uwb", "gps", "wifi", "rfid", "ibeacon", "virtual", "unknown"]
Milliseconds = Annotated[
    FiniteFloat, Field(ge=-1, description="Milliseconds; -1: without end. Stored, not used."), NumberOnly
]
Metres = Annotated[FiniteFloat, Field(ge=0), NumberOnly]
Name = Annotated[str, Field(max_length=MAX_NAME)]


class OmloxObject(BaseModel):
    """Other fields are allowed and dropped: hubs add fields of their own."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class Point(OmloxObject):
    """A position of GeoJSON: [longitude, latitude] or [x, y], perhaps with a height."""

    type: Literal["Point"]
    coordinates: Position


class Polygon(OmloxObject):
    """A polygon of GeoJSON: closed rings, the first of which is the outline."""

    type: Literal["Polygon"]
    coordinates: list[Annotated[list[Position], Field(min_length=4, max_length=MAX_POINTS + 1)]] = Field(
        min_length=1, max_length=MAX_RINGS
    )


class _Fencing(OmloxObject):
    """Settings that this service stores and returns. Its fences go by the probability of being inside instead."""

    fence_timeout: Milliseconds | None = None
    exit_tolerance: Metres | None = None
    tolerance_timeout: Milliseconds | None = None
    exit_delay: Milliseconds | None = None


class LocationProvider(_Fencing):
    """A tag."""

    id: str = Field(max_length=64, description="Id of the tag.")
    type: ProviderType
    name: Name | None = None
    sensors: Annotated[Any, AfterValidator(_storable)] = None
    properties: StoredProperties | None = None


class LocatingRule(OmloxObject):
    """Which of several providers counts. Stored and returned; this service takes the most accurate one."""

    expression: Annotated[str, Field(max_length=1000)]
    priority: Number


class Trackable(_Fencing):
    """Something that carries location providers."""

    id: UUID | None = None
    type: Literal["omlox", "virtual"]
    name: Name | None = None
    geometry: Polygon | None = None
    extrusion: Metres | None = None
    location_providers: Annotated[list[Annotated[str, Field(max_length=64)]], Field(max_length=1000)] | None = None
    radius: Metres | None = None
    properties: StoredProperties | None = None
    locating_rules: Annotated[list[LocatingRule], Field(max_length=100)] | None = None


class Fence(OmloxObject):
    """An area. A zone of this service: both interfaces show and change the same one."""

    id: UUID | None = None
    region: Point | Polygon = Field(discriminator="type")
    radius: Number | None = Field(default=None, description="Of a circle around a point, m.")
    extrusion: Metres | None = None
    floor: Number | None = None
    foreign_id: Annotated[str, Field(max_length=200)] | None = None
    name: Name | None = None
    timeout: Milliseconds | None = None
    exit_tolerance: Metres | None = None
    tolerance_timeout: Milliseconds | None = None
    exit_delay: Milliseconds | None = None
    crs: str | None = Field(default=None, description="`local` or `EPSG:4326`, which is meant without it.")
    zone_id: str | None = Field(default=None, max_length=64, description="Required with the crs `local`.")
    elevation_ref: Literal["floor", "wgs84"] | None = None
    properties: StoredProperties | None = None
