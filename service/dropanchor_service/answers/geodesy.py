"""Convert positions between the site frame and WGS 84 latitude and longitude."""

import numpy as np
from pymap3d.enu import enu2geodetic, geodetic2enu

from dropanchor_schemas.site import Georeference
from dropanchor_service.estimation.columns import Array


def lat_lon(origin: Georeference, x: Array, y: Array) -> tuple[Array, Array]:
    """Return latitude and longitude, degrees, of points (x, y) [m]; the longitude is in [-180, 180]. NaN stays NaN.

    The points lie on the plane that touches the ellipsoid at the site's origin.
    """
    cos_r, sin_r = np.cos(origin.rotation_rad), np.sin(origin.rotation_rad)
    east, north = cos_r * x - sin_r * y, sin_r * x + cos_r * y
    lat, lon, _ = enu2geodetic(east, north, np.zeros_like(east), origin.lat, origin.lon, 0.0)
    return lat, lon


def altitude(origin: Georeference, z: Array) -> Array | None:
    """Return the altitudes, m, of points at these heights of the site; None where that of the site is not known."""
    return None if origin.alt_m is None else origin.alt_m + z


def site_xy(origin: Georeference, lat: Array, lon: Array) -> tuple[Array, Array]:
    """Return the points (x, y) [m] of the site frame below or above these latitudes and longitudes, degrees."""
    cos_r, sin_r = np.cos(origin.rotation_rad), np.sin(origin.rotation_rad)
    east, north, _ = geodetic2enu(lat, lon, np.zeros_like(lat), origin.lat, origin.lon, 0.0)
    return cos_r * east + sin_r * north, cos_r * north - sin_r * east
