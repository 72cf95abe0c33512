"""Latitude and longitude, checked with the inverse conversion of the textbook, which shares no code with ours."""

import numpy as np
import pytest

from dropanchor_schemas.site import Georeference
from dropanchor_service.answers.geodesy import lat_lon
from dropanchor_service.estimation.columns import Array


def ecef(lat_deg: Array, lon_deg: Array, height_m: Array) -> Array:
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    e2 = 0.00669437999014
    normal = 6378137.0 / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    across = (normal + height_m) * np.cos(lat)
    return np.stack([across * np.cos(lon), across * np.sin(lon), (normal * (1 - e2) + height_m) * np.sin(lat)])


@pytest.mark.parametrize("lat0", [-89.9, -45.0, 0.0, 52.5, 85.0])
@pytest.mark.parametrize("lon0", [-179.999, 0.0, 13.4])
def test_points_of_the_plane_convert_back_within_a_millimetre(lat0: float, lon0: float) -> None:
    x, y = np.meshgrid(np.linspace(-2000, 2000, 5), np.linspace(-2000, 2000, 5))
    lat, lon = lat_lon(Georeference(lat=lat0, lon=lon0), x, y)
    # The plane rises above the ellipsoid with the distance. The height moves its points along the normal only.
    height = np.hypot(x, y) ** 2 / (2 * 6.371e6)
    offset = ecef(lat, lon, height) - ecef(np.array(lat0), np.array(lon0), np.array(0.0))[:, None, None]
    phi, lam = np.radians(lat0), np.radians(lon0)
    east = -np.sin(lam) * offset[0] + np.cos(lam) * offset[1]
    north = -np.sin(phi) * (np.cos(lam) * offset[0] + np.sin(lam) * offset[1]) + np.cos(phi) * offset[2]
    # 4 m of height, known to 0.7 %, times a tilt of 2 km in 6371 km: less than 0.01 mm.
    assert np.abs(east - x).max() < 1e-3
    assert np.abs(north - y).max() < 1e-3


def test_a_rotated_site_turns_around_its_origin() -> None:
    turned = Georeference(lat=52.5, lon=13.4, rotation_rad=np.pi / 2)
    straight = Georeference(lat=52.5, lon=13.4)
    one, none = np.array([100.0]), np.array([0.0])
    assert np.allclose(lat_lon(turned, one, none), lat_lon(straight, none, one), rtol=0, atol=1e-12)


def test_across_the_date_line_the_longitude_changes_its_sign() -> None:
    _, lon = lat_lon(Georeference(lat=0, lon=179.999), np.array([0.0, 1000.0]), np.zeros(2))
    assert lon == pytest.approx([179.999, 179.999 + 1000 / 111_319.49 - 360], abs=1e-6)


def test_an_unknown_position_stays_unknown() -> None:
    lat, lon = lat_lon(Georeference(lat=1, lon=2), np.array([np.nan]), np.array([0.0]))
    assert np.isnan([lat, lon]).all()
