"""A served page with a base map behind a turned site."""

import cmath
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pymap3d.enu import enu2geodetic
from pyproj import Transformer

from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.basemap.basemap import ServedBasemap
from service.dashboard.place import Place, live_api_bench
from support.basemap_files import Tile
from support.http_server import running_server

ORIGIN = Georeference(lat=52.5163, lon=13.3777, rotation_rad=0.7)
SITE = Site(anchors=[Anchor(id="17"), Anchor(id="18", x=300, y=200)], georeference=ORIGIN)
_HALF_M = 20_037_508.342789244
_TO_MERCATOR = Transformer.from_crs("EPSG:4326", "EPSG:3857", always_xy=True)


@contextmanager
def basemap_place(path: Path, attribution: str | None = None) -> Iterator[Place]:
    """Serve a page until the block ends."""
    bench, basemap = live_api_bench(SITE), ServedBasemap(path, attribution)
    with running_server(bench.app(DASHBOARD, basemap=basemap), bench.stopping) as port:
        yield Place(bench, f"http://127.0.0.1:{port}/")
    basemap.file.close()


def mercator_of(x: float, y: float) -> tuple[float, float]:
    """Return where a place of the site lies in the tile at zoom 0, by pymap3d and PROJ."""
    east_north = complex(x, y) * cmath.exp(1j * ORIGIN.rotation_rad)
    lat, lon, _ = enu2geodetic(east_north.real, east_north.imag, 0.0, ORIGIN.lat, ORIGIN.lon, 0.0)
    east, north = _TO_MERCATOR.transform(lon, lat)
    return (east + _HALF_M) / (2 * _HALF_M), (_HALF_M - north) / (2 * _HALF_M)


def tile_at(z: int, x: float, y: float) -> tuple[Tile, tuple[float, float]]:
    """Return the tile at a place of the site, and where in the tile that is, from 0 to 1."""
    column, line = (2**z * value for value in mercator_of(x, y))
    return (z, int(column), int(line)), (column % 1, line % 1)


def tiles_around(z: int, half_m: float) -> set[Tile]:
    """Return the tiles that lie around the origin of the site."""
    (_, left, top), _ = tile_at(z, 0, 0)
    reach = int(half_m / (24_000_000 / 2**z)) + 1
    return {(z, left + i, top + j) for i in range(-reach, reach + 1) for j in range(-reach, reach + 1)}
