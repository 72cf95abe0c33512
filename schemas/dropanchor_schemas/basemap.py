"""Models of the base map: tiles that the page shows behind a site with latitude and longitude."""

from typing import Annotated, Literal

from pydantic import BaseModel, Field

TileMediaType = Literal["image/png", "image/jpeg", "image/webp", "image/avif", "application/vnd.mapbox-vector-tile"]
Zoom = Annotated[int, Field(ge=0, le=255)]


class Credit(BaseModel):
    """A part of the attribution."""

    text: str
    link: str | None = Field(description="Where the text leads; null: nowhere.")


class BasemapTiles(BaseModel):
    """The tiles of a base map, in web Mercator as OpenStreetMap numbers them."""

    version: str = Field(description="Differs when the service shows another file.")
    media_type: TileMediaType
    min_zoom: Zoom
    max_zoom: Zoom
    west: float = Field(description="Edge of the part of the world that it shows, degrees.")
    south: float
    east: float
    north: float
    attribution: list[Credit] = Field(
        description="Who made the map, in the order of the text. Whoever shows the map has to show this."
    )


class Basemap(BaseModel):
    """The base map of the service."""

    tiles: BasemapTiles | None = Field(description="null: the service has no base map.")
