"""Coordinates of omlox objects: those of the site frame (`local`), or longitude and latitude (`EPSG:4326`)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dropanchor_schemas.site import Georeference, Site
from dropanchor_service.answers.answers import Answer
from dropanchor_service.answers.geodesy import lat_lon, site_xy
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.omlox.models import LOCAL, WGS84

DECIMALS, DEGREE_DECIMALS = 4, 9


@dataclass(frozen=True)
class Projection:
    """Turns points of the site into coordinates of an answer, and back. origin: None for the site frame itself."""

    origin: Georeference | None

    @property
    def crs(self) -> str:
        return LOCAL if self.origin is None else WGS84

    def places(self, poses: Sequence[Answer]) -> list[list[float]]:
        """Return the coordinates of placed poses: [x, y, z] in the site frame, and on earth with altitude if known."""
        name = "z" if self.origin is None else "alt_m"
        places = self.coordinates([(pose["x"], pose["y"]) for pose in poses])
        heights = [pose[name] for pose in poses]
        return [
            place if height is None or not math.isfinite(height) else [*place, round(height, DECIMALS)]
            for place, height in zip(places, heights, strict=True)
        ]

    def elevation(self, place: Sequence[float]) -> dict[str, str]:
        """Return what says what the third of these coordinates is. In the site frame that is the default."""
        return {"elevation_ref": "wgs84"} if self.origin is not None and len(place) == 3 else {}

    def coordinates(self, points: Sequence[Sequence[float]]) -> list[list[float]]:
        """Return the coordinates of these points (x, y), m."""
        if self.origin is None:
            return [[round(x, DECIMALS), round(y, DECIMALS)] for x, y in points]
        lat, lon = lat_lon(self.origin, *np.array(points, float).reshape(-1, 2).T)
        found: list[list[float]] = np.column_stack([lon, lat]).round(DEGREE_DECIMALS).tolist()
        return found

    def point(self, x: float, y: float) -> dict[str, Any]:
        """Return the point of GeoJSON."""
        return {"type": "Point", "coordinates": self.coordinates([(x, y)])[0]}

    def site_points(self, coordinates: Sequence[Sequence[float]]) -> list[list[float]]:
        """Return the points (x, y) [m] of coordinates; a height is dropped."""
        flat = np.array([pair[:2] for pair in coordinates], float).reshape(-1, 2)
        if self.origin is not None:
            flat = np.column_stack(site_xy(self.origin, flat[:, 1], flat[:, 0]))
        points: list[list[float]] = flat.tolist()
        return points


def projection_of(site: Site, crs: str | None, geojson: bool = False) -> Projection:
    """Return the projection that a client asks for. Raises ProblemError.

    Without a wish it is WGS 84 where the site has a georeference: clients that do not look at `crs` draw what they get
    on a map of the world.
    """
    if geojson and crs == LOCAL:
        raise ProblemError(Kind.INVALID_REQUEST, "GeoJSON holds only EPSG:4326: leave out `crs` or `geojson`.")
    if crs == LOCAL or (crs is None and site.georeference is None and not geojson):
        return Projection(None)
    if crs not in (None, WGS84):
        raise ProblemError(Kind.INVALID_REQUEST, f"The crs must be {LOCAL} or {WGS84}.")
    if site.georeference is None:
        raise ProblemError(
            Kind.NOT_GEOREFERENCED,
            "Longitude and latitude are unknown. Set `georeference` with PUT /api/v1/site, or use the crs local.",
        )
    return Projection(site.georeference)
