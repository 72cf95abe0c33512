"""Find out where a georeferenced image lies in the site frame."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from PIL import Image
from pymap3d.enu import geodetic2enu

from dropanchor_schemas.plans import MAX_M_PER_PX, Placement
from dropanchor_schemas.sentences import said_by, say
from dropanchor_schemas.site import Georeference
from dropanchor_schemas.zones import MAX_COORDINATE_M

SITE = "site"
"""The name of the site frame, where others have EPSG codes."""

_PIXEL_SCALE, _TIEPOINT, _TRANSFORMATION, _GEO_KEYS = 33550, 33922, 34264, 34735  # tags of TIFF
_RASTER_TYPE, _GEOGRAPHIC, _PROJECTED = 1025, 2048, 3072  # keys of GeoTIFF
_POINT = 2  # raster type: coordinates name the centre of a pixel, not its corner
_USER_DEFINED = 32767
_MAX_DISTORTION = 0.01

Affine = tuple[float, float, float, float, float, float]
"""a, b, c, d, e, f of easting = a·column + b·row + c and northing = d·column + e·row + f; (0, 0) is the corner of the
first pixel."""


class UnplacedError(Exception):
    """The image does not tell where it lies. The message says why."""


def affine_of_world_file(numbers: list[float]) -> Affine:
    """Return the transformation of a world file, whose six numbers are those of pixel centres."""
    a, d, b, e, c, f = numbers
    return _from_centres((a, b, c, d, e, f))


def affine_of_tiff(image: Image.Image) -> tuple[Affine, str] | None:
    """Return the transformation and the coordinate system of a GeoTIFF, which may be empty; None for another TIFF."""
    tags: Mapping[int, Any] = getattr(image, "tag_v2", {})
    keys = _geo_keys(tags.get(_GEO_KEYS, ()))
    if _TRANSFORMATION in tags and len(tags[_TRANSFORMATION]) == 16:
        m = tags[_TRANSFORMATION]
        affine: Affine = (m[0], m[1], m[3], m[4], m[5], m[7])
    elif len(tags.get(_PIXEL_SCALE, ())) >= 2 and len(tags.get(_TIEPOINT, ())) >= 6:
        (sx, sy), (column, row, _, x, y, _) = tags[_PIXEL_SCALE][:2], tags[_TIEPOINT][:6]
        affine = (sx, 0.0, x - column * sx, 0.0, -sy, y + row * sy)
    else:
        return None
    code = keys.get(_PROJECTED, keys.get(_GEOGRAPHIC, _USER_DEFINED))
    crs = "" if code == _USER_DEFINED else f"EPSG:{code}"
    return (_from_centres(affine) if keys.get(_RASTER_TYPE) == _POINT else affine), crs


def placement_of(affine: Affine, size: tuple[int, int], crs: str, origin: Georeference | None) -> Placement:
    """Return where the image lies. crs: SITE, or a code such as EPSG:25832. Raises UnplacedError."""
    if not crs:
        raise UnplacedError(
            say(
                "ground_no_crs",
                "The file names no coordinate system that is known. Upload it with one, such as EPSG:25832.",
            )
        )
    width, height = size
    columns, rows = np.array([0.0, width, width, 0.0]), np.array([0.0, 0.0, height, height])
    a, b, c, d, e, f = affine
    x, y = _in_site(a * columns + b * rows + c, d * columns + e * rows + f, crs, origin)
    if not max(np.abs(x).max(), np.abs(y).max()) <= MAX_COORDINATE_M:
        raise UnplacedError(
            say(
                "ground_far",
                "The image does not lie within 100 km of the site's origin. Is its coordinate system right?",
            )
        )
    return _fitted(columns - width / 2, height / 2 - rows, x, y)


def _in_site(easting: Any, northing: Any, crs: str, origin: Georeference | None) -> tuple[Any, Any]:
    if crs == SITE:
        return easting, northing
    if origin is None:
        raise UnplacedError(
            say(
                "ground_no_georeference",
                "The file says where it lies, but the site has no georeference. Align the plan by hand.",
            )
        )
    lon, lat = _degrees(easting, northing, crs)
    east, north, _ = geodetic2enu(lat, lon, np.zeros_like(lat), origin.lat, origin.lon, 0.0)
    cos_r, sin_r = math.cos(origin.rotation_rad), math.sin(origin.rotation_rad)
    return cos_r * east + sin_r * north, cos_r * north - sin_r * east


def _degrees(easting: Any, northing: Any, crs: str) -> tuple[Any, Any]:
    """Return longitude and latitude. Raises UnplacedError."""
    try:
        from pyproj import CRS, Transformer
        from pyproj.exceptions import ProjError
    except ModuleNotFoundError as error:
        raise UnplacedError(
            say("no_pyproj", "{crs} needs the extra `maps`: pip install 'dropanchor-service[maps]'", crs=crs)
        ) from error
    try:
        lon, lat = Transformer.from_crs(CRS.from_user_input(crs), "EPSG:4326", always_xy=True).transform(
            easting, northing
        )
    except ProjError as error:
        raise UnplacedError(
            say("ground_crs", "The coordinate system {crs} cannot be used: {why}", crs=crs, why=said_by(error))
        ) from error
    return lon, lat


def _fitted(right: Any, up: Any, x: Any, y: Any) -> Placement:
    """Return the similarity that brings the corners to (x, y) with the least squared error. Raises UnplacedError.

    right, up: the corners in pixels from the centre.
    """
    pixels, places = right + 1j * up, x + 1j * y
    centre = places.mean()
    factor = np.vdot(pixels, places - centre) / np.vdot(pixels, pixels)
    residual = np.abs(places - centre - factor * pixels).max()
    if not 0 < np.abs(factor) <= MAX_M_PER_PX or not residual <= _MAX_DISTORTION * np.abs(places - centre).max():
        raise UnplacedError(
            say(
                "ground_mirrored",
                "Its pixels are not square on the ground, or mirrored, so a turn and a scale cannot place "
                "it. Convert it to a metric coordinate system, such as UTM, or align it by hand.",
            )
        )
    return Placement(
        x=float(centre.real),
        y=float(centre.imag),
        rotation_rad=float(np.angle(factor)),
        m_per_px=float(np.abs(factor)),
    )


def _from_centres(affine: Affine) -> Affine:
    """Return the transformation from corners of pixels, given the one from their centres."""
    a, b, c, d, e, f = affine
    return a, b, c - (a + b) / 2, d, e, f - (d + e) / 2


def _geo_keys(directory: Any) -> dict[int, int]:
    """Return the keys of a GeoTIFF that hold a number of their own."""
    entries = [directory[start : start + 4] for start in range(4, len(directory) - 3, 4)]
    return {key: value for key, location, _count, value in entries if location == 0}
