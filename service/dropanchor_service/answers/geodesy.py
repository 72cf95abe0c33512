"""Positions in the site frame as WGS 84 latitude and longitude.

Constants: NIMA TR8350.2 (2000), table 3.1. ECEF from a local tangent plane and Bowring's closed form back to
geodetic coordinates: Hofmann-Wellenhof et al., GNSS, 2008, sections 8.2 and 8.3.
"""

import numpy as np

from dropanchor_schemas.site import Georeference
from dropanchor_service.estimation.batch import Array

SEMI_MAJOR_M = 6_378_137.0
FLATTENING = 1 / 298.257223563
_ECCENTRICITY2 = FLATTENING * (2 - FLATTENING)
_SEMI_MINOR_M = SEMI_MAJOR_M * (1 - FLATTENING)


def lat_lon(origin: Georeference, x: Array, y: Array) -> tuple[Array, Array]:
    """Degrees, of points (x, y) [m] on the plane that touches the ellipsoid at the site's origin; NaN stays NaN."""
    cos_r, sin_r = np.cos(origin.rotation_rad), np.sin(origin.rotation_rad)
    east, north = cos_r * x - sin_r * y, sin_r * x + cos_r * y
    lat0, lon0 = np.radians(origin.lat), np.radians(origin.lon)
    prime_vertical_m = SEMI_MAJOR_M / np.sqrt(1 - _ECCENTRICITY2 * np.sin(lat0) ** 2)
    # In the meridian plane of the origin: away from the axis, along it, and across the plane to the east.
    outward = prime_vertical_m * np.cos(lat0) - north * np.sin(lat0)
    up = prime_vertical_m * (1 - _ECCENTRICITY2) * np.sin(lat0) + north * np.cos(lat0)
    lon = lon0 + np.arctan2(east, outward)
    return np.degrees(_latitude(np.hypot(outward, east), up)), _wrapped(np.degrees(lon))


def _latitude(from_axis: Array, up: Array) -> Array:
    """Bowring's closed form, rad: far below a millimetre near the ground."""
    reduced = np.arctan2(up * SEMI_MAJOR_M, from_axis * _SEMI_MINOR_M)
    second_eccentricity2 = _ECCENTRICITY2 / (1 - _ECCENTRICITY2)
    return np.arctan2(
        up + second_eccentricity2 * _SEMI_MINOR_M * np.sin(reduced) ** 3,
        from_axis - _ECCENTRICITY2 * SEMI_MAJOR_M * np.cos(reduced) ** 3,
    )


def _wrapped(lon_deg: Array) -> Array:
    """In [-180, 180)."""
    return (lon_deg + 180.0) % 360.0 - 180.0
